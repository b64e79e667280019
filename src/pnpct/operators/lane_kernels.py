"""Moving images and rays into lanes and back, for the CPU kernels."""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float32]

_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "cache": True}
_TILE = 16
_RUN = 64


def aligned(shape: tuple[int, ...]) -> Array:
    """Return zeros that begin on a cache line; vector loads that straddle two cost a tenth to a third more."""
    count = int(np.prod(shape))
    raw = np.zeros(count + 16, np.float32)
    skip = (-raw.ctypes.data % 64) // 4
    return raw[skip : skip + count].reshape(shape)


@njit(inline="always")
def _frame(rows, cols, turns):
    """Height and width of the turned image, and where row 0 and column 0 of the unturned one begin in it."""
    if len(turns) > 1:  # a square around the image
        side = max(rows, cols)
        return side, side, (side - rows) // 2, (side - cols) // 2
    if turns[0] % 2 == 1:
        return cols, rows, 0, 0
    return rows, cols, 0, 0


@njit(inline="always")
def _unturned(i, j, turn, height, width):
    """Where the pixel (i, j) of the image after `turn` clockwise quarter turns was before them."""
    if turn == 0:
        return i, j
    if turn == 1:
        return width - 1 - j, i
    if turn == 2:
        return height - 1 - i, width - 1 - j
    return j, height - 1 - i


@njit(inline="always")
def _turned(i, j, turn, height, width):
    """Inverse of `_unturned`."""
    if turn == 0:
        return i, j
    if turn == 1:
        return j, width - 1 - i
    if turn == 2:
        return height - 1 - i, width - 1 - j
    return height - 1 - j, i


@njit(**_OPTIONS)
def pack_image(images, turns, first_slice, left, lanes, first, last):
    """Fill rows first … last − 1 of lanes [row][left + column][slice · turns + turn] with the turned images.

    Columns beside the image, rows below it and lanes without a slice become zero: the transpose writes there.
    """
    slices, rows, cols = images.shape
    height, width, above, beside = _frame(rows, cols, turns)
    for row0 in range(first, last, _TILE):
        row1 = min(row0 + _TILE, last)
        lanes[row0:row1] = 0
        for lane in range(lanes.shape[2]):
            index, turn = first_slice + lane // len(turns), turns[lane % len(turns)]
            if index >= slices:
                continue
            image = images[index]
            for col0 in range(0, width, _TILE):
                for row in range(row0, min(row1, height)):
                    for col in range(col0, min(col0 + _TILE, width)):
                        i, j = _unturned(row, col, turn, height, width)
                        i, j = i - above, j - beside
                        if 0 <= i < rows and 0 <= j < cols:
                            lanes[row, col + left, lane] = image[i, j]


@njit(**_OPTIONS)
def unpack_image(lanes, turns, first_slice, left, images, fresh, first, last):
    """Add the lanes, turned back, to rows first … last − 1 of the images, which are zeroed first if fresh."""
    slices, rows, cols = images.shape
    height, width, above, beside = _frame(rows, cols, turns)
    for row0 in range(first, last, _TILE):
        row1 = min(row0 + _TILE, last)
        for index in range(first_slice, min(slices, first_slice + lanes.shape[2] // len(turns))):
            image = images[index]
            if fresh:
                image[row0:row1] = 0
            for col0 in range(0, cols, _TILE):
                for number in range(len(turns)):
                    lane, turn = (index - first_slice) * len(turns) + number, turns[number]
                    for row in range(row0, row1):
                        for col in range(col0, min(col0 + _TILE, cols)):
                            i, j = _turned(row + above, col + beside, turn, height, width)
                            image[row, col] += lanes[i, j + left, lane]


@njit(**_OPTIONS)
def pack_rays(rays, measured, parts, first_slice, lanes, first, last):
    """Fill the strips of cells first … last − 1 in lanes [strip][slice · turns + turn] from rays [slice][ray]."""
    turns = measured.shape[1]
    for cell0 in range(first, last, _RUN):
        for lane in range(lanes.shape[1]):
            index, turn = first_slice + lane // turns, lane % turns
            for cell in range(cell0, min(cell0 + _RUN, last)):
                ray = measured[cell, turn]
                value = rays[index, ray] if ray >= 0 and index < rays.shape[0] else np.float32(0)
                for part in range(cell * parts, (cell + 1) * parts):
                    lanes[part, lane] = value


@njit(**_OPTIONS)
def unpack_rays(lanes, measured, parts, first_slice, rays, first, last):
    """Set rays [slice][ray] to the sum of the strips of each of the cells first … last − 1."""
    turns = measured.shape[1]
    for cell0 in range(first, last, _RUN):
        for lane in range(lanes.shape[1]):
            index, turn = first_slice + lane // turns, lane % turns
            if index >= rays.shape[0]:
                continue
            for cell in range(cell0, min(cell0 + _RUN, last)):
                ray = measured[cell, turn]
                if ray >= 0:
                    total = np.float32(0)
                    for part in range(cell * parts, (cell + 1) * parts):
                        total += lanes[part, lane]
                    rays[index, ray] = total
