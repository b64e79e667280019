"""Moving volumes and rays into the order of the cone beam's kernels, and back."""

import math
from typing import Any

import numpy as np
from numba import njit

_OPTIONS: dict[str, Any] = {"nogil": True, "fastmath": True, "error_model": "numpy", "cache": True}
_TILE = 16


@njit(**_OPTIONS)
def pack_volume(volume, margin, packed, first, last):
    """Fill packed [margin + row][margin + column][slice] with rows first … last − 1 of volume [slice][row][column]."""
    slices, _, cols = volume.shape
    for row in range(first, last):
        for col0 in range(0, cols, _TILE):
            for z in range(slices):
                for col in range(col0, min(col0 + _TILE, cols)):
                    packed[margin + row, margin + col, z] = volume[z, row, col]


@njit(**_OPTIONS)
def unpack_volume(packed, margin, volume, first, last):
    """Set rows first … last − 1 of volume [slice][row][column] to those of packed."""
    slices, _, cols = volume.shape
    for row in range(first, last):
        for col0 in range(0, cols, _TILE):
            for z in range(slices):
                for col in range(col0, min(col0 + _TILE, cols)):
                    volume[z, row, col] = packed[margin + row, margin + col, z]


@njit(**_OPTIONS)
def pack_rays(rays, place, heights, packed, pad, squared, first, last):
    """Fill cells first … last − 1 of packed [cell][pad + detector row] with rays [view][row][bin] times the paths.

    Args:
        rays: What is measured.
        place: Of each cell its view, its bin, the path through a row of the image, and one over the distance from the
            focal spot.
        heights: Of each view and detector row, above the focal spot.
        packed: Zeros; of each cell `pad` of them stay before its rows, and maybe some after them.
        pad: Zeros before the rows.
        squared: Whether times the squares of the paths.
        first: Cells.
        last: Cells.
    """
    view, cell_bin, length, nearness = place
    rows = rays.shape[1]
    for cell0 in range(first, last, _TILE):
        cell1 = min(cell0 + _TILE, last)
        for row in range(rows):
            for cell in range(cell0, cell1):
                rise = heights[view[cell], row] * nearness[cell]
                path = length[cell] * math.sqrt(np.float32(1) + rise * rise)
                value = rays[view[cell], row, cell_bin[cell]]
                packed[cell, pad + row] = value * path * path if squared else value * path


@njit(**_OPTIONS)
def unpack_rays(packed, place, heights, rays, pad, first, last):
    """Set rays [view][row][bin] to the cells first … last − 1 of packed [cell][pad + detector row] times the paths."""
    view, cell_bin, length, nearness = place
    for cell0 in range(first, last, _TILE):
        cell1 = min(cell0 + _TILE, last)
        for row in range(rays.shape[1]):
            for cell in range(cell0, cell1):
                rise = heights[view[cell], row] * nearness[cell]
                path = length[cell] * math.sqrt(np.float32(1) + rise * rise)
                rays[view[cell], row, cell_bin[cell]] = packed[cell, pad + row] * path
