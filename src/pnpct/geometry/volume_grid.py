"""A stack of image grids."""

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from pnpct.geometry.image_grid import FARTHEST, ImageGrid


@dataclass(frozen=True)
class VolumeGrid:
    """Slices with the same pixels, evenly spaced along z; slice 0 is the lowest, the nearest to the feet.

    Args:
        plane: The pixels of each slice.
        slices: Number of slices, at least 1.
        slice_spacing: Distance between the middles of neighbouring slices, mm; of one slice alone its thickness.
        z: Height of the middle of the stack, mm, growing towards the head.

    Raises:
        ValueError: If there is no slice, the spacing is not positive, or a slice more than a kilometre away.

    Example:
        >>> grid = VolumeGrid(ImageGrid(64, 64, spacing=0.8), slices=4, slice_spacing=2.5, z=10.0)
        >>> grid.shape, grid.heights.tolist()
        ((4, 64, 64), [6.25, 8.75, 11.25, 13.75])
    """

    plane: ImageGrid
    slices: int
    slice_spacing: float
    z: float = 0.0

    def __post_init__(self) -> None:
        if self.slices < 1:
            raise ValueError(f"A volume needs at least one slice, got {self.slices}.")
        if not (math.isfinite(self.slice_spacing) and self.slice_spacing > 0):
            raise ValueError(f"The distance between slices must be a positive length in mm, got {self.slice_spacing}.")
        if not math.isfinite(self.z):
            raise ValueError(f"The height of a volume must be a finite length in mm, got {self.z}.")
        if abs(self.z) + self.slices * self.slice_spacing / 2 > FARTHEST:
            raise ValueError(f"A volume must lie within 1 km of the isocentre, got {self} around z = {self.z:g} mm.")

    def __str__(self) -> str:
        number = f"{self.slices} slices {self.slice_spacing:.4g} mm apart" if self.slices > 1 else "1 slice"
        return f"{number} of {self.plane}"

    @property
    def shape(self) -> tuple[int, int, int]:
        """Slices, rows and columns."""
        return self.slices, self.plane.rows, self.plane.cols

    @property
    def heights(self) -> NDArray[np.float64]:
        """Heights of the middles of the slices, mm; growing."""
        z: NDArray[np.float64] = np.arange(self.slices, dtype=np.float64) - (self.slices - 1) / 2
        return self.z + z * self.slice_spacing


Grid: TypeAlias = ImageGrid | VolumeGrid
"""Where pixels are; `shape` is that of an image or a volume without a batch."""


def require_image_grid(grid: Grid) -> ImageGrid:
    """Return the grid, if it is that of an image: for what works on one plane only.

    Raises:
        ValueError: If it is that of a volume.
    """
    if isinstance(grid, VolumeGrid):
        raise ValueError(f"An image of one plane is needed, but this is a volume: {grid}; give a single image.")
    return grid
