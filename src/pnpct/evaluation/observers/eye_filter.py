"""The eye of a reader: how well it sees each spatial frequency of an image on a screen."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Spectrum: TypeAlias = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""From frequencies in 1/mm to a value at each."""


@dataclass(frozen=True)
class EyeFilter:
    """The contrast sensitivity of a reader at a distance from a screen.

    E(ρ) = |ρ^1.5 exp(−c ρ^0.68)|² / max, with ρ = f · distance · π/180 / zoom in cycles per degree. State
    distance and zoom with the result.

    Args:
        distance: From the eye to the screen, mm, positive.
        zoom: Size on the screen over size in the patient, positive.
        decay: The constant c, positive: 0.98 (Eckstein) or 3.22 (Saunders).

    Raises:
        ValueError: If a number is not positive.

    References:
        AAPM Task Group 233, Med. Phys. 46 (2019) e735, doi 10.1002/mp.13763.

    Example:
        >>> EyeFilter()(np.array([0.0])).tolist()
        [0.0]
    """

    distance: float = 500.0
    zoom: float = 1.0
    decay: float = 0.98

    def __post_init__(self) -> None:
        for name, value in (("distance", self.distance), ("zoom", self.zoom), ("decay", self.decay)):
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"The {name} of an eye filter must be positive, got {value}.")

    def __call__(self, frequencies: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return E, 0 to 1, at frequencies in 1/mm."""
        peak = (1.5 / (0.68 * self.decay)) ** (1 / 0.68)
        rho = np.abs(frequencies) * self.distance * math.pi / 180 / self.zoom
        response = rho**1.5 * np.exp(-self.decay * rho**0.68)
        squared: NDArray[np.float64] = (response / (peak**1.5 * math.exp(-self.decay * peak**0.68))) ** 2
        return squared
