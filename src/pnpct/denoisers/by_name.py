"""The classical denoisers by name."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

from pnpct.arrays import Image
from pnpct.denoisers.gaussian import Gaussian
from pnpct.denoisers.nonlocal_means import NonlocalMeans
from pnpct.denoisers.quadratic import Quadratic
from pnpct.denoisers.total_variation import TotalVariation

Denoise: TypeAlias = Callable[[Image], Image]
"""From a noisy image to a less noisy one, of the same shape; the strength is bound inside."""


@dataclass(frozen=True)
class Classical:
    """A classical denoiser as the commands offer it.

    Args:
        make: Makes it from its strength.
        unit: Unit of the strength.
        usual: Strength that suits a low-dose scan of a body.
    """

    make: Callable[[float], Denoise]
    unit: str
    usual: float


DENOISERS = {
    "tv": Classical(lambda strength: TotalVariation(strength / 1000), "HU × pixel", 70.0),
    "nonlocal-means": Classical(lambda strength: NonlocalMeans(strength / 1000), "HU of noise", 70.0),
    "quadratic": Classical(Quadratic, "pixels²", 4.0),
    "gaussian": Classical(Gaussian, "pixels", 1.0),
}
"""The classical denoisers; a line here makes one known to all commands."""


def make_denoiser(name: str, strength: float | None = None) -> Denoise:
    """Make one of the classical denoisers.

    Args:
        name: One of `DENOISERS`.
        strength: How much it smooths, in its own unit, from 0 (not at all); its usual strength if None.

    Returns:
        The denoiser, with the strength bound inside.

    Raises:
        ValueError: If nothing has this name, or the strength is negative or not finite.

    Example:
        >>> make_denoiser("tv", 30.0)
        TotalVariation(strength=0.03, iterations=200, tolerance=0.001, across=0.0)
    """
    if name not in DENOISERS:
        raise ValueError(f'There is no denoiser "{name}"; there are {", ".join(DENOISERS)}.')
    known = DENOISERS[name]
    strength = known.usual if strength is None else strength
    if not 0 <= strength < math.inf:  # in its own unit: the denoisers' own errors are in units of the image
        raise ValueError(f"The strength of {name} is a number of {known.unit} from 0 up, got {strength:g}.")
    return known.make(strength)
