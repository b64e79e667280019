"""How far apart the distributions of gray values of two images are."""

import itertools
import math

import numpy as np
from jaxtyping import Bool, Float
from numpy.typing import NDArray
from scipy.stats import wasserstein_distance
from torch import Tensor

from pnpct.arrays import Image
from pnpct.evaluation.image.hounsfield import check_window, hu_array


def gray_levels(
    image_hu: NDArray[np.float64], *, window: tuple[float, float] = (-120.0, 180.0), levels: int = 256
) -> NDArray[np.uint8]:
    """Sort HU values into equal bins of a fixed window.

    q = min(⌊clip((HU − low)/(high − low), 0, 1) · levels⌋, levels − 1).

    Args:
        image_hu: HU.
        window: Lower and upper end of the histogram, HU.
        levels: Number of bins, 2 to 256.

    Returns:
        Levels from 0 to levels − 1, of the shape of the image.

    Raises:
        ValueError: If the window has no width or the number of levels is out of its range.
    """
    check_window(window)
    if not 2 <= levels <= 256:
        raise ValueError(f"The number of gray levels is from 2 to 256, got {levels}.")
    relative = np.clip((image_hu - window[0]) / (window[1] - window[0]), 0.0, 1.0)
    return np.minimum(np.floor(relative * levels), levels - 1).astype(np.uint8)


def gray_histogram(
    image: Image,
    *,
    window: tuple[float, float] = (-120.0, 180.0),
    mask: Bool[Tensor, "..."] | None = None,
    levels: int = 256,
) -> NDArray[np.float64]:
    """Count the gray levels of an image and divide by the number of pixels.

    Args:
        image: Attenuation relative to water.
        window: Lower and upper end of the histogram, HU; values outside count in the end bins.
        mask: Where to count, of the image's shape; everywhere if None.
        levels: Number of bins, 2 to 256.

    Returns:
        The share of each level, [levels]; the sum is 1.

    Raises:
        ValueError: If a number is not finite or out of its range, or the mask does not fit or is empty.
    """
    hu = hu_array(image)
    if mask is not None:
        if mask.shape != image.shape:
            raise ValueError(f"A mask must have the shape of its image, {tuple(image.shape)}, got {tuple(mask.shape)}.")
        hu = hu[mask.cpu().numpy()]
    if hu.size == 0:
        raise ValueError("A histogram needs at least one pixel; the mask or the image is empty.")
    counts = np.bincount(gray_levels(hu, window=window, levels=levels).ravel(), minlength=levels)
    shares: NDArray[np.float64] = counts / hu.size
    return shares


def earth_movers_distance(
    image: Image,
    reference: Float[Tensor, "..."],
    *,
    window: tuple[float, float] = (-120.0, 180.0),
    mask: Bool[Tensor, "..."] | None = None,
    levels: int = 256,
) -> float:
    """Return the earth mover's distance between the histograms of an image and its reference.

    W₁ = Σₖ |CDF(k) − CDF_reference(k)| / (levels − 1): the window is the axis from 0 to 1, both histograms are
    taken on it and have the sum 1. Times the width of the window it is in HU. It knows nothing of where in the
    image a value stands; quote it beside `repeat_scan_floor`.

    Args:
        image: Attenuation relative to water.
        reference: What it should be, of the same shape.
        window: Lower and upper end of the histogram, HU.
        mask: Where to count in both, of the same shape; everywhere if None.
        levels: Number of bins, 2 to 256.

    Returns:
        A number from 0 (the same histogram) to 1 (one all below, the other all above the window).

    Raises:
        ValueError: If the shapes differ, a number is not finite or out of its range, or the mask is empty.

    References:
        The paper, section on evaluation: EMD of 256-bin normalised histograms.
        Rubner, Tomasi and Guibas, Int. J. Comput. Vis. 40 (2000) 99.

    Example:
        >>> import torch
        >>> earth_movers_distance(torch.zeros(4, 4), torch.full((4, 4), 2.0))
        1.0
    """
    if image.shape != reference.shape:
        raise ValueError(
            f"An image and its reference must have one shape, got {tuple(image.shape)} and {tuple(reference.shape)}."
        )
    shares, shares_of_reference = (
        gray_histogram(one, window=window, mask=mask, levels=levels) for one in (image, reference)
    )
    axis = np.arange(levels) / (levels - 1)
    return float(wasserstein_distance(axis, axis, shares, shares_of_reference))


def repeat_scan_floor(
    repeats: Float[Tensor, "repeats rows cols"],
    *,
    window: tuple[float, float] = (-120.0, 180.0),
    mask: Bool[Tensor, "rows cols"] | None = None,
    levels: int = 256,
) -> float:
    """Return the earth mover's distance between independent repeats of the reference scan.

    A distance below this does not distinguish an image from the reference: it is the mean over all pairs of repeats,
    which differ in nothing but their noise.

    Args:
        repeats: Two or more images of one object at the dose of the reference, attenuation relative to water.
        window: Lower and upper end of the histogram, HU.
        mask: Where to count; everywhere if None.
        levels: Number of bins, 2 to 256.

    Returns:
        The mean distance on the axis from 0 to 1.

    Raises:
        ValueError: If there are fewer than two repeats, and as `earth_movers_distance`.
    """
    if repeats.shape[0] < 2:
        raise ValueError(f"The floor needs two repeats of the scan or more, got {repeats.shape[0]}.")
    distances = [
        earth_movers_distance(first, second, window=window, mask=mask, levels=levels)
        for first, second in itertools.combinations(repeats, 2)
    ]
    return math.fsum(distances) / len(distances)
