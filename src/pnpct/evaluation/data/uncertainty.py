"""How sure the values of an image are: their spread over repetitions, and what that spread leaves out."""

from collections.abc import Iterable
from dataclasses import dataclass

import torch

from pnpct.arrays import Image
from pnpct.evaluation.data.realisations import ReconstructViews, split_views
from pnpct.evaluation.image.regions import Mask
from pnpct.operators import Projector
from pnpct.physics import Sinogram

WITHIN = 1.96
"""Standard deviations that 95 % of Gaussian values stay within."""

TOO_FEW = 0.8
"""A coverage below this means that the standard deviations must not be shown as the uncertainty."""


@dataclass(frozen=True, eq=False)
class Spread:
    """Mean and standard deviation of repeated images, pixel by pixel.

    Args:
        mean: Attenuation relative to water. Less the image that the repetitions were drawn from, it is their bias.
        sd: Standard deviation, of an unbiased variance, relative to water: 0.01 is 10 HU.
        realisations: How many images there were.
    """

    mean: Image
    sd: Image
    realisations: int


@dataclass(frozen=True)
class Coverage:
    """How often the truth is where the standard deviations say.

    Args:
        share: Of the pixels whose error is at most 1.96 standard deviations, 0 to 1; 0.95 is right.
        pixels: How many were looked at.
    """

    share: float
    pixels: int

    @property
    def too_low(self) -> bool:
        """Whether less than 80 % are covered: bias of the prior outweighs the noise, so show no sd without it."""
        return self.share < TOO_FEW


def spread(images: Iterable[Image]) -> Spread:
    """Return mean and standard deviation over images, one at a time; none is kept.

    Of `parametric_bootstrap` they tell how much noise is in an image. They do not tell its error: what the prior adds
    to all of them alike has no spread. Show them with the bias, or with the verifiable contrast of `score_test`.

    Args:
        images: Repetitions of one image, at least 2; 20 to 50 are usual, and 20 know a standard deviation to 16 %.

    Returns:
        Mean and standard deviation, in the precision of the images.

    Raises:
        ValueError: If there are fewer than two images, or their shapes differ.

    Example:
        >>> spread([torch.zeros(1, 1), torch.ones(1, 1)]).sd
        tensor([[0.7071]])
    """
    count, mean, squares = 0, torch.zeros(()), torch.zeros(())
    for count, image in enumerate(images, start=1):
        value = image.detach().double()
        if count == 1:
            mean, squares, like = value.clone(), torch.zeros_like(value), image
        if value.shape != mean.shape:
            raise ValueError(f"All images must have one shape, got {tuple(mean.shape)} and {tuple(value.shape)}.")
        before = value - mean
        mean = mean + before / count
        squares = squares + before * (value - mean)
    if count < 2:
        raise ValueError(f"A standard deviation needs two images or more, got {count}.")
    return Spread(mean.to(like), (squares / (count - 1)).sqrt().to(like), count)


def coverage(image: Image, truth: Image, sd: Image, *, mask: Mask | None = None) -> Coverage:
    """Return the share of pixels with |image − truth| ≤ 1.96 sd.

    Args:
        image: Attenuation relative to water.
        truth: The known object.
        sd: Standard deviation of the image, as of `spread`.
        mask: Where to count; everywhere if None.

    Returns:
        The share: 0.95 if noise is all that is wrong with the image and the standard deviations are right.

    Raises:
        ValueError: If the shapes differ, or the mask is empty.
    """
    mask = torch.ones_like(image, dtype=torch.bool) if mask is None else mask
    shapes = [tuple(each.shape) for each in (image, truth, sd, mask)]
    if len(set(shapes)) > 1:
        raise ValueError(f"Image, truth, standard deviation and mask must have one shape, got {shapes}.")
    pixels = int(mask.sum())
    if pixels == 0:
        raise ValueError("The mask is empty; there is no pixel to look at.")
    covered = (image.detach() - truth).abs() <= WITHIN * sd
    return Coverage(share=int(covered[mask].sum()) / pixels, pixels=pixels)


def split_view_difference(reconstruct: ReconstructViews, sinogram: Sinogram, projector: Projector) -> Image:
    """Return half the difference of the images from the even and the odd views: a picture of the noise.

    For a linear reconstruction it has the noise of the image of all views, and no object, but for streaks that half of
    the views leave. A prior that invents the same structure from both halves does not show.

    Args:
        reconstruct: The reconstruction, for any set of views.
        sinogram: The data of all views.
        projector: A of all views.

    Returns:
        Attenuation relative to water.

    Raises:
        ValueError: If there are fewer than two views, or the noise of the rays is correlated.
    """
    even, odd = (reconstruct(half.sinogram, half.projector) for half in split_views(sinogram, projector))
    return (even - odd) / 2
