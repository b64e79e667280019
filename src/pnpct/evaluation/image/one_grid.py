"""Whether the pixels of two images are at the same places."""

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from pnpct.geometry import Grid, ImageGrid, VolumeGrid


def on_one_grid(image: tuple[Tensor, Grid], truth: tuple[Tensor, Grid]) -> tuple[Tensor, Tensor]:
    """Return an image and the truth with the same axes, where their pixels are at the same places.

    A single slice of a volume and an image, which has no height, are compared in their plane.

    Args:
        image: The image or volume, with any batch, and its grid.
        truth: The truth, likewise.

    Raises:
        ValueError: If the pixels or slices lie elsewhere, by more than a hundredth of their spacing.
    """
    if not (isinstance(image[1], VolumeGrid) and isinstance(truth[1], VolumeGrid)):
        image, truth = _single_slice_flat(*image), _single_slice_flat(*truth)
    (values, grid), (true_values, true_grid) = image, truth
    if grid.shape != true_grid.shape:
        raise ValueError(f"The image has {_size(grid)} pixels, the truth {_size(true_grid)}; reconstruct on its grid.")
    plane, true_plane = _plane(grid), _plane(true_grid)
    allowed = 0.01 * true_plane.spacing
    if _apart(plane.x, true_plane.x) > allowed or _apart(plane.y, true_plane.y) > allowed:
        raise ValueError(
            f"The pixels of the image are not where those of the truth are: {_place(plane)} against "
            f"{_place(true_plane)}; reconstruct on its grid."
        )
    if isinstance(grid, VolumeGrid) and isinstance(true_grid, VolumeGrid):
        z, true_z = grid.heights, true_grid.heights
        if _apart(z, true_z) > 0.01 * true_grid.slice_spacing:
            raise ValueError(
                f"The slices of the image are not at the heights of the truth: z = {z[0]:.6g} to {z[-1]:.6g} mm "
                f"against {true_z[0]:.6g} to {true_z[-1]:.6g} mm; reconstruct on its grid."
            )
    return values, true_values


def _single_slice_flat(image: Tensor, grid: Grid) -> tuple[Tensor, Grid]:
    return (image[..., 0, :, :], grid.plane) if isinstance(grid, VolumeGrid) and grid.slices == 1 else (image, grid)


def _plane(grid: Grid) -> ImageGrid:
    return grid.plane if isinstance(grid, VolumeGrid) else grid


def _size(grid: Grid) -> str:
    return " x ".join(map(str, grid.shape))


def _place(grid: ImageGrid) -> str:
    return f"{grid.spacing:.6g} mm apart around ({grid.center[0]:g}, {grid.center[1]:g}) mm"


def _apart(positions: NDArray[np.float64], others: NDArray[np.float64]) -> float:
    return float(np.abs(positions - others).max())
