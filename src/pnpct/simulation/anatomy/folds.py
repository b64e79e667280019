"""Sheets that meander through space: the folds of a brain, the walls between air cells."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pnpct.simulation.anatomy.shapes import Array


@dataclass(frozen=True, eq=False)
class Folds:
    """Sheets half a wavelength apart: where a sum of plane waves of one wavelength in random directions is 0.

    In a slice they are lines that wind, branch and close on themselves.

    Args:
        waves: Wave vectors, 2π / wavelength long, 1/mm.
        phases: Phase of each wave at the origin, rad.
    """

    waves: NDArray[np.float64]
    phases: NDArray[np.float64]

    def distance(self, x: Array, y: Array, z: Array | float) -> Array:
        """Return the distance to the nearest sheet, mm, from 0 to a quarter of the wavelength."""
        value, across, up, along = (np.float32(0.0) + np.zeros_like(x) for _ in range(4))
        for (a, b, c), phase in zip(self.waves.tolist(), self.phases.tolist(), strict=True):
            angle = a * x + b * y + (c * z + phase)
            value, slope = value + np.cos(angle), np.sin(angle)
            across, up, along = across + a * slope, up + b * slope, along + c * slope
        number = float(np.linalg.norm(self.waves[0]))
        steepness = np.sqrt(across**2 + up**2 + along**2)
        # Right for one wave, to first order near the sheets of many.
        distance: Array = np.arctan2(number * np.abs(value), steepness) / number
        return distance


def random_folds(generator: np.random.Generator, wavelength: float, *, count: int = 14) -> Folds:
    """Draw folds.

    Args:
        generator: Generator of directions and phases.
        wavelength: Twice the mean distance between sheets, mm.
        count: Number of waves.
    """
    directions = generator.standard_normal((count, 3))
    waves = directions * (2 * math.pi / wavelength / np.linalg.norm(directions, axis=1, keepdims=True))
    return Folds(waves, generator.uniform(0, 2 * math.pi, count))
