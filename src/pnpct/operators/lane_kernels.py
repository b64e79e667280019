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
def _margins(rows, cols, turns):
    """Rows above and columns beside the image in the square that several turns need."""
    side = max(rows, cols)
    return ((side - rows) // 2, (side - cols) // 2) if len(turns) > 1 else (0, 0)


@njit(inline="always")
def _turned_view(rows, cols, stride, turn):
    """Walk an image of the given size as it looks after `turn` clockwise quarter turns.

    Returns height and width, and in memory the first pixel, the step per row and the step per column.
    """
    if turn == 0:
        return rows, cols, 0, stride, 1
    if turn == 1:
        return cols, rows, (rows - 1) * stride, 1, -stride
    if turn == 2:
        return rows, cols, (rows - 1) * stride + cols - 1, -stride, -1
    return cols, rows, cols - 1, -1, stride


@njit(**_OPTIONS)
def pack_image(images, turns, first_slice, left, lanes, first, last):
    """Fill rows first … last − 1 of lanes [row][left + column][slice · turns + turn] with the turned images.

    Columns beside the image, rows below it and lanes without a slice become zero: the transpose writes there.
    """
    slices, rows, cols = images.shape
    above, beside = _margins(rows, cols, turns)
    for row0 in range(first, last, _TILE):
        row1 = min(row0 + _TILE, last)
        lanes[row0:row1] = 0
        for lane in range(lanes.shape[2]):
            index, turn = first_slice + lane // len(turns), turns[lane % len(turns)]
            if index >= slices:
                continue
            image = images[index].reshape(rows * cols)
            height, width, origin, per_row, per_col = _turned_view(rows, cols, cols, turn)
            top, side = (above, beside) if turn % 2 == 0 else (beside, above)
            for col0 in range(0, width, _TILE):
                for row in range(max(row0, top), min(row1, top + height)):
                    at = origin + (row - top) * per_row
                    for col in range(col0, min(col0 + _TILE, width)):
                        lanes[row, left + side + col, lane] = image[at + col * per_col]


@njit(**_OPTIONS)
def unpack_image(lanes, turns, first_slice, left, images, fresh, first, last):
    """Add the lanes, turned back, to rows first … last − 1 of the images, which are zeroed first if fresh."""
    slices, rows, cols = images.shape
    above, beside = _margins(rows, cols, turns)
    values, width = lanes.reshape(lanes.size), lanes.shape[1]
    size = lanes.shape[2]
    for row0 in range(first, last, _TILE):
        row1 = min(row0 + _TILE, last)
        for index in range(first_slice, min(slices, first_slice + size // len(turns))):
            image = images[index]
            if fresh:
                image[row0:row1] = 0
            for col0 in range(0, cols, _TILE):
                col1 = min(col0 + _TILE, cols)
                for number in range(len(turns)):
                    turn = turns[number]
                    height, across = (rows, cols) if turn % 2 == 0 else (cols, rows)
                    top, side = (above, beside) if turn % 2 == 0 else (beside, above)
                    # Turning back is turning on to the full turn.
                    _, _, origin, per_row, per_col = _turned_view(height, across, width, (4 - turn) % 4)
                    lane = (index - first_slice) * len(turns) + number
                    origin += top * width + left + side
                    for row in range(row0, row1):
                        at = origin + row * per_row
                        for col in range(col0, col1):
                            image[row, col] += values[(at + col * per_col) * size + lane]


@njit(**_OPTIONS)
def pack_rays(rays, measured, parts, first_slice, lanes, first, last):
    """Fill the strips of cells first … last − 1 in lanes [strip][slice · turns + turn] from rays [slice][ray]."""
    turns = measured.shape[1]
    for cell0 in range(first, last, _RUN):
        cell1 = min(cell0 + _RUN, last)
        for lane in range(lanes.shape[1]):
            index, turn = first_slice + lane // turns, lane % turns
            if index >= rays.shape[0]:
                lanes[cell0 * parts : cell1 * parts, lane] = 0
                continue
            line = rays[index]
            for cell in range(cell0, cell1):
                ray = measured[cell, turn]
                value = line[ray] if ray >= 0 else np.float32(0)
                if parts == 1:
                    lanes[cell, lane] = value
                else:
                    lanes[cell * parts : (cell + 1) * parts, lane] = value


@njit(**_OPTIONS)
def unpack_rays(lanes, measured, parts, first_slice, rays, first, last):
    """Set rays [slice][ray] to the sum of the strips of each of the cells first … last − 1."""
    turns = measured.shape[1]
    for cell0 in range(first, last, _RUN):
        cell1 = min(cell0 + _RUN, last)
        for lane in range(lanes.shape[1]):
            index, turn = first_slice + lane // turns, lane % turns
            if index >= rays.shape[0]:
                continue
            line = rays[index]
            for cell in range(cell0, cell1):
                ray = measured[cell, turn]
                if ray < 0:
                    continue
                if parts == 1:
                    line[ray] = lanes[cell, lane]
                else:
                    line[ray] = lanes[cell * parts : (cell + 1) * parts, lane].sum()
