"""The classical denoisers by name."""

from collections.abc import Callable
from typing import TypeAlias

from pnpct.arrays import Image
from pnpct.denoisers.gaussian import Gaussian
from pnpct.denoisers.nonlocal_means import NonlocalMeans
from pnpct.denoisers.total_variation import TotalVariation

Denoise: TypeAlias = Callable[[Image], Image]
"""From a noisy image to a less noisy one, of the same shape; the strength is bound inside."""

DENOISERS: dict[str, Callable[[float], Denoise]] = {
    "tv": lambda strength_hu: TotalVariation(strength_hu / 1000),  # HU × pixel
    "nonlocal-means": lambda strength_hu: NonlocalMeans(strength_hu / 1000),  # HU of noise
    "gaussian": lambda strength_pixels: Gaussian(strength_pixels),  # a blur knows no HU: s.d. in pixels
}
"""A denoiser for each name, made from its strength: HU × pixel, HU, and pixels."""


def make_denoiser(name: str, strength: float) -> Denoise:
    """Make one of the classical denoisers.

    Args:
        name: One of `DENOISERS`.
        strength: How much it smooths, from 0 (not at all): for "tv" in HU × pixel, for "nonlocal-means" the
            s.d. of the noise in HU, for "gaussian" the s.d. of the blur in pixels.

    Returns:
        The denoiser, with the strength bound inside.

    Raises:
        ValueError: If nothing has this name, or the strength is negative or not finite.

    Example:
        >>> make_denoiser("tv", 30.0)
        TotalVariation(strength=0.03, iterations=200, tolerance=0.001)
    """
    if name not in DENOISERS:
        raise ValueError(f'There is no denoiser "{name}"; there are {", ".join(DENOISERS)}.')
    return DENOISERS[name](strength)
