"""Square patches of an image: where texture and noise are measured."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray
from torch import Tensor

from pnpct.evaluation.image.hounsfield import hu_array
from pnpct.geometry import ImageGrid


@dataclass(frozen=True, order=True)
class Patch:
    """The corner of a square patch: its first row and column.

    Args:
        row: First row, from 0.
        col: First column, from 0.

    Raises:
        ValueError: If a number is negative.
    """

    row: int
    col: int

    def __post_init__(self) -> None:
        if self.row < 0 or self.col < 0:
            raise ValueError(f"A patch begins inside the image, got row {self.row} and column {self.col}.")


def tile_patches(shape: tuple[int, int], *, size: int = 64, stride: int | None = None) -> tuple[Patch, ...]:
    """Cover an image with patches from its first row and column on; what is left at the far borders stays out.

    Args:
        shape: Rows and columns of the image.
        size: Side of a patch, pixels, at least 1.
        stride: Distance between corners, pixels, at least 1; `size` if None, so that patches do not overlap.

    Returns:
        The patches, row by row.

    Raises:
        ValueError: If a size is below 1 or the image is smaller than a patch.

    Example:
        >>> tile_patches((5, 4), size=2)[:3]
        (Patch(row=0, col=0), Patch(row=0, col=2), Patch(row=2, col=0))
    """
    step = size if stride is None else stride
    if size < 1 or step < 1:
        raise ValueError(f"Patches and the steps between them have at least one pixel, got {size} and {step}.")
    rows, cols = shape
    if min(rows, cols) < size:
        raise ValueError(f"The image must hold a patch of {size} x {size} pixels, got {rows} x {cols}.")
    return tuple(Patch(row, col) for row in range(0, rows - size + 1, step) for col in range(0, cols - size + 1, step))


def patches_in_square(
    grid: ImageGrid, *, center: tuple[float, float], side: float, size: int = 64
) -> tuple[tuple[Patch, ...], int]:
    """Cover a square region of an image with patches.

    Args:
        grid: Where the pixels are.
        center: Middle (x, y) of the region, mm.
        side: Of the region, mm, at least 8 pixels.
        size: Largest side of a patch, pixels; a smaller region is one patch.

    Returns:
        The patches side by side, and their side in pixels.

    Raises:
        ValueError: If the region is too small, or not all of it is in the image.

    Example:
        >>> patches_in_square(ImageGrid(64, 64, spacing=0.5), center=(0.0, 0.0), side=20.0, size=20)
        ((Patch(row=12, col=12), Patch(row=12, col=32), Patch(row=32, col=12), Patch(row=32, col=32)), 20)
    """
    across = math.floor(side / grid.spacing + 1e-6) if math.isfinite(side) else 0
    if across < 8:
        raise ValueError(f"A region has sides of at least 8 pixels ({8 * grid.spacing:g} mm), got {side:g} mm.")
    row = round(float((grid.y[0] - center[1]) / grid.spacing) - (across - 1) / 2)
    col = round(float((center[0] - grid.x[0]) / grid.spacing) - (across - 1) / 2)
    if min(row, col) < 0 or row + across > grid.rows or col + across > grid.cols:
        place = f"{side:g} mm around ({center[0]:g}, {center[1]:g}) mm"
        raise ValueError(f"A region must be in the image, of {grid}, got one of {place}.")
    size = min(size, across)
    inside = tile_patches((across, across), size=size)
    return tuple(Patch(row + patch.row, col + patch.col) for patch in inside), size


def patch_values(image: Float[Tensor, "*batch rows cols"], patches: Sequence[Patch], size: int) -> NDArray[np.float64]:
    """Cut patches out of an image or of each of a stack.

    Args:
        image: Attenuation relative to water.
        patches: Where.
        size: Side of the patches, pixels.

    Returns:
        HU, [*batch, patches, size, size].

    Raises:
        ValueError: If there is no patch, one reaches out of the image, or a number is not finite.
    """
    rows, cols = image.shape[-2:]
    if not patches:
        raise ValueError("There is no patch to measure on; loosen the selection or choose patches by hand.")
    outside = [patch for patch in patches if patch.row + size > rows or patch.col + size > cols]
    if outside:
        raise ValueError(f"Every patch of {size} pixels must be inside the {rows} x {cols} image, got {outside[0]}.")
    hu = hu_array(image)
    return np.stack([hu[..., patch.row : patch.row + size, patch.col : patch.col + size] for patch in patches], axis=-3)
