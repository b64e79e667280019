"""How far an image is from a reference: errors in HU, signal-to-noise ratio and structural similarity."""

import math
from collections.abc import Callable, Mapping
from typing import TypeAlias

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from pnpct.arrays import Image
from pnpct.evaluation.image.hounsfield import check_window
from pnpct.evaluation.image.regions import Mask, body_mask, soft_tissue_mask
from pnpct.units import to_hu

Metric: TypeAlias = Callable[[Image, Image], float]
"""From an image and its reference to one number."""

Window: TypeAlias = tuple[float, float]
"""Lower and upper end of a display window, HU."""

WINDOWS: dict[str, Window] = {
    "abdomen": (-160.0, 240.0),  # level 40, width 400
    "mediastinum": (-120.0, 180.0),  # level 30, width 300
    "lung": (-1350.0, 150.0),  # level -600, width 1500
    "brain": (0.0, 80.0),  # level 40, width 80
}
"""Display windows in HU, (level − width/2, level + width/2)."""


class NoSuchTissueError(ValueError):
    """A mask is empty: the reference has no pixel of this kind."""


def rmse_hu(image: Image, reference: Float[Tensor, "..."], *, mask: Bool[Tensor, "..."] | None = None) -> float:
    """Return the root mean square difference, HU.

    Args:
        image: Attenuation relative to water.
        reference: What it should be, of the same shape.
        mask: Where to count, of the same shape; everywhere if None.

    Returns:
        √mean((HU − HU_reference)²), over all pixels and all leading dimensions (realisations or independent objects).

    Raises:
        ValueError: If the shapes differ or a number is not finite; NoSuchTissueError if the mask is empty.

    Example:
        >>> rmse_hu(torch.full((4, 4), 1.25), torch.ones(4, 4))
        250.0
    """
    return math.sqrt(_difference_hu(image, reference, mask).square().mean().item())


def bias_hu(image: Image, reference: Float[Tensor, "..."], *, mask: Bool[Tensor, "..."] | None = None) -> float:
    """Return the mean of image minus reference, HU; arguments and errors as `rmse_hu`."""
    return _difference_hu(image, reference, mask).mean().item()


def psnr(
    image: Image, reference: Float[Tensor, "..."], *, window: Window, mask: Bool[Tensor, "..."] | None = None
) -> float:
    """Return the peak signal-to-noise ratio inside a display window, dB.

    10 log₁₀(width² / mean((HU − HU_reference)²)), both clipped to the window. Without the clipping bone and
    the skin line decide: the order of two images can turn round with the window, so it belongs to the number.

    Args:
        image: Attenuation relative to water.
        reference: What it should be, of the same shape.
        window: Lowest and highest value, HU, say one of `WINDOWS`; its width is the data range.
        mask: Where to count, of the same shape; everywhere if None.

    Returns:
        Decibels, from the mean over all leading dimensions; infinite if the images agree in the window.

    Raises:
        ValueError: If the shapes differ, a number is not finite, the window has no width, or the mask is empty.
    """
    image_hu, reference_hu = _windowed(image, reference, window)
    error = _where(mask, (image_hu - reference_hu).square()).mean().item()
    return 10 * math.log10((window[1] - window[0]) ** 2 / error) if error > 0 else math.inf


def ssim(
    image: Image, reference: Float[Tensor, "..."], *, window: Window, mask: Bool[Tensor, "..."] | None = None
) -> float:
    """Return the mean structural similarity inside a display window, as in its authors' paper.

    With local means μ, variances σ² and covariance σ_ab under a Gaussian of 1.5 pixels s.d. on 11 × 11
    pixels,

        SSIM = (2 μ_a μ_b + C₁)(2 σ_ab + C₂) / ((μ_a² + μ_b² + C₁)(σ_a² + σ_b² + C₂)),

    C₁ = (0.01 width)², C₂ = (0.03 width)², both images clipped to the window and counted from its lower end,
    averaged over all pixels whose surroundings lie inside the image.

    Args:
        image: Attenuation relative to water.
        reference: What it should be, of the same shape, at least 11 × 11 pixels.
        window: Lowest and highest value, HU, say one of `WINDOWS`; its width is the data range.
        mask: The pixels to average over, of the same shape; all if None. Their surroundings count in any case.

    Returns:
        A number from −1 to 1, averaged over all leading dimensions; 1 if the images agree in the window.

    Raises:
        ValueError: If the shapes differ or are too small, a number is not finite, the window has no width, or the
            mask is empty where the surroundings lie inside the image.

    References:
        Wang, Bovik, Sheikh and Simoncelli, IEEE Trans. Image Process. 13 (2004) 600.
    """
    a, b = (hu - window[0] for hu in _windowed(image, reference, window))
    if min(a.shape[-2:]) < 11:
        raise ValueError(f"Structural similarity needs images of at least 11 x 11 pixels, got {tuple(a.shape)}.")
    c1, c2 = ((k * (window[1] - window[0])) ** 2 for k in (0.01, 0.03))
    mean_a, mean_b, mean_aa, mean_bb, mean_ab = _local_mean(torch.stack([a, b, a * a, b * b, a * b]))
    covariance = mean_ab - mean_a * mean_b
    variances = mean_aa - mean_a**2 + mean_bb - mean_b**2
    similarity = (2 * mean_a * mean_b + c1) * (2 * covariance + c2)
    similarity /= (mean_a**2 + mean_b**2 + c1) * (variances + c2)
    return float(_where(None if mask is None else mask[..., 5:-5, 5:-5], similarity).mean())


def _within(metric: Callable[..., float], region: Callable[[Image], Mask], **settings: Window) -> Metric:
    return lambda image, reference: metric(image, reference, mask=region(reference), **settings)


METRICS: dict[str, Metric] = {
    "rmse_hu": rmse_hu,
    "bias_hu": bias_hu,
    "body_rmse_hu": _within(rmse_hu, body_mask),
    "body_bias_hu": _within(bias_hu, body_mask),
    "soft_tissue_rmse_hu": _within(rmse_hu, soft_tissue_mask),
    "soft_tissue_bias_hu": _within(bias_hu, soft_tissue_mask),
    "psnr_40_400": _within(psnr, body_mask, window=WINDOWS["abdomen"]),
    "ssim_40_400": _within(ssim, body_mask, window=WINDOWS["abdomen"]),
    "psnr_30_300": _within(psnr, body_mask, window=WINDOWS["mediastinum"]),
    "ssim_30_300": _within(ssim, body_mask, window=WINDOWS["mediastinum"]),
}
"""The default of `evaluate`. The names of PSNR and SSIM end in level and width of their window. Both are taken over the
body alone: air, which every method gets right, would raise them."""


def evaluate(
    image: Image, reference: Float[Tensor, "..."], *, metrics: Mapping[str, Metric] = METRICS
) -> dict[str, float]:
    """Compare an image with its reference by several metrics.

    Args:
        image: Attenuation relative to water.
        reference: What it should be, of the same shape. An image of another scan, however high its dose, has
            noise of its own, which counts as error of the image.
        metrics: Metric for each name.

    Returns:
        The value for each name, in the order of `metrics`.

    Raises:
        ValueError: If the shapes differ or a number is not finite; NoSuchTissueError if the reference has no such
            tissue.
    """
    return {name: metric(image, reference) for name, metric in metrics.items()}


def checked_hu(image: Tensor, reference: Tensor) -> tuple[Tensor, Tensor]:
    """Return an image and its reference in HU and double precision.

    Raises:
        ValueError: If the shapes differ or a number is not finite.
    """
    if image.shape != reference.shape:
        raise ValueError(
            f"An image and its reference must have one shape, got {tuple(image.shape)} and {tuple(reference.shape)}."
        )
    for name, array in (("image", image), ("reference", reference)):
        if not torch.isfinite(array).all():
            raise ValueError(f"The {name} has values that are not finite; nothing can be measured on it.")
    return to_hu(image.detach().double()), to_hu(reference.detach().double())


def _difference_hu(image: Tensor, reference: Tensor, mask: Tensor | None) -> Tensor:
    image_hu, reference_hu = checked_hu(image, reference)
    return _where(mask, image_hu - reference_hu)


def _where(mask: Tensor | None, values: Tensor) -> Tensor:
    if mask is None:
        return values
    if mask.shape != values.shape:
        raise ValueError(f"A mask must have the shape of its image, {tuple(values.shape)}, got {tuple(mask.shape)}.")
    if not mask.any():
        raise NoSuchTissueError("The mask is empty: the reference has no pixel of this kind of tissue.")
    return values[mask]


def _windowed(image: Tensor, reference: Tensor, window: Window) -> tuple[Tensor, Tensor]:
    check_window(window)
    image_hu, reference_hu = checked_hu(image, reference)
    return image_hu.clamp(*window), reference_hu.clamp(*window)


def _local_mean(images: Tensor) -> Tensor:
    offsets = torch.arange(-5, 6, dtype=images.dtype, device=images.device)
    kernel = torch.exp(-0.5 * (offsets / 1.5) ** 2)
    kernel /= kernel.sum()
    flat = images.reshape(-1, 1, *images.shape[-2:])
    along_rows = torch.nn.functional.conv2d(flat, kernel.view(1, 1, 1, -1))
    mean = torch.nn.functional.conv2d(along_rows, kernel.view(1, 1, -1, 1))
    return mean.reshape(*images.shape[:-2], *mean.shape[-2:])
