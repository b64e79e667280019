"""Lesions and inserts of known size, place and contrast."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pnpct.geometry.image_grid import ImageGrid


@dataclass(frozen=True)
class Lesion:
    """A sphere that is brighter or darker than what is there without it.

    Args:
        center: Its middle x, y and z, mm.
        radius: mm, > 0.
        contrast_hu: What it adds at 70 keV, HU; negative for a dark one.

    Raises:
        ValueError: If a number is not finite, or the radius is not positive.

    Example:
        >>> Lesion((10.0, 0.0, 0.0), radius=4.0, contrast_hu=-20.0).radius
        4.0
    """

    center: tuple[float, float, float]
    radius: float
    contrast_hu: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.radius) and self.radius > 0):
            raise ValueError(f"The radius of a lesion must be a positive length in mm, got {self.radius}.")
        if not all(map(math.isfinite, (*self.center, self.contrast_hu))):
            raise ValueError(f"The centre and the contrast of a lesion must be finite, got {self}.")


@dataclass(frozen=True)
class Insert:
    """A cylinder along z in a phantom of water, with contrast from density alone.

    Args:
        diameter: mm, > 0.
        contrast_hu: What it adds to water, HU; negative for a dark one.
        center: Its middle x and y, mm.

    Raises:
        ValueError: If a number is not finite, or the diameter is not positive.

    Example:
        >>> Insert(diameter=3.0, contrast_hu=14.0, center=(20.0, 0.0)).diameter
        3.0
    """

    diameter: float
    contrast_hu: float
    center: tuple[float, float]

    def __post_init__(self) -> None:
        if not (math.isfinite(self.diameter) and self.diameter > 0):
            raise ValueError(f"The diameter of an insert must be a positive length in mm, got {self.diameter}.")
        if not all(map(math.isfinite, (self.contrast_hu, *self.center))):
            raise ValueError(f"The contrast and the centre of an insert must be finite, got {self}.")


def disc_mask(center: tuple[float, float], radius: float, grid: ImageGrid) -> NDArray[np.float64]:
    """Return the fraction of each pixel inside a disc: 1 within, 0 without, and between on the outline.

    The outline is one pixel wide: w = ½ − (distance from the centre − radius) / spacing, from 0 to 1.

    Args:
        center: Its middle x and y, mm.
        radius: mm.
        grid: Where the pixels are.

    Example:
        >>> disc_mask((0.0, 0.0), 1.0, ImageGrid(1, 5, spacing=1.0)).tolist()
        [[0.0, 0.5, 1.0, 0.5, 0.0]]
    """
    return lesion_mask([Lesion((*center, 0.0), radius, 0.0)], 0.0, grid)


def lesion_mask(lesions: Sequence[Lesion], z: float, grid: ImageGrid) -> NDArray[np.float64]:
    """Return the fraction of each pixel inside a lesion; the outline is that of `disc_mask`, of a sphere.

    Where lesions overlap it is that of the one to which more of the pixel belongs.

    Args:
        lesions: Any number.
        z: Height of the slice, mm.
        grid: Where the pixels are.
    """
    mask = np.zeros(grid.shape)
    for lesion in lesions:
        x, y, height = lesion.center
        away = np.sqrt((grid.x[None, :] - x) ** 2 + (grid.y[:, None] - y) ** 2 + (z - height) ** 2)
        mask = np.maximum(mask, np.clip(0.5 - (away - lesion.radius) / grid.spacing, 0.0, 1.0))
    return mask
