"""Noise-conditioned networks: those that take the noise level beside the image."""

from collections.abc import Callable
from typing import TypeAlias

from jaxtyping import Float
from torch import Tensor, nn

from pnpct.arrays import Image

NoiseLevel: TypeAlias = float | Float[Tensor, "..."]
"""Standard deviation of the noise in units of the image (0.03 is 30 HU): a number, or what broadcasts to the image."""

NoiseOf: TypeAlias = Callable[[Image], NoiseLevel]
"""What gives the noise level of each image that is denoised, and so of each iteration."""

_MEDIAN = 0.6745
"""The median of the absolute value of noise with a standard deviation of 1."""


def is_noise_conditioned(network: nn.Module) -> bool:
    """Return whether a network takes the noise level beside the image: it then has a true `noise_input`."""
    return bool(getattr(network, "noise_input", False))


def check_noise_level(network: nn.Module, noise_level: NoiseLevel | NoiseOf | None) -> None:
    """Refuse a noise level that is missing or not applicable.

    Raises:
        ValueError: If a noise-conditioned network gets none, or another one gets one.
    """
    if is_noise_conditioned(network) and noise_level is None:
        raise ValueError("This network is noise-conditioned: give it the noise level, a standard deviation.")
    if noise_level is not None and not is_noise_conditioned(network):
        raise ValueError("This network is not noise-conditioned and takes no noise level; leave it out.")


def estimated_noise(image: Image) -> Float[Tensor, "*batch 1 1"]:
    """Estimate the standard deviation of the noise of each image, where it is denser than half of water.

    The median of |Δ|, Δ the second difference along the rows of that along the columns, which smooth tissue and
    straight edges do not have. It is right for white noise; of the noise of sharp FBP, which is finer, it says too
    much, of smoothed noise too little.

    Args:
        image: Relative to water, at least 3 × 3 pixels.

    Returns:
        A number for each image, in its units.

    Raises:
        ValueError: If the images are smaller.

    References:
        Immerkær, Comput. Vis. Image Underst. 64 (1996) 300, with the median for the mean.

    Example:
        >>> import torch
        >>> noise = 0.05 * torch.randn(64, 64, generator=torch.Generator().manual_seed(1))
        >>> round(estimated_noise(1 + noise).item(), 3)
        0.05
    """
    if min(image.shape[-2:]) < 3:
        raise ValueError(f"Noise is estimated on at least 3 x 3 pixels, got {tuple(image.shape)}.")
    differences = image.diff(n=2, dim=-2).diff(n=2, dim=-1).abs()
    dense = image[..., 1:-1, 1:-1] > 0.5
    dense |= ~dense.any(-1, keepdim=True).any(-2, keepdim=True)
    median = differences.where(dense, float("nan")).flatten(-2).nanmedian(-1).values
    return median[..., None, None] / (6 * _MEDIAN)  # 6² is the sum of the squares of (1, -2, 1)ᵀ (1, -2, 1)
