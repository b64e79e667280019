"""The loops of a cone beam's projector on a CPU, compiled by numba: over rows of the image, strips, and rays."""

from typing import Any

import numpy as np
from numba import njit

from pnpct.operators.cone.cone_kernels import (
    CHUNK,
    PAD,
    TAPS,
    UNROLLED,
    WIDTH,
    gather2,
    gather3,
    scatter2,
    scatter3,
    to_rows,
    to_slices,
    weigh,
)

MARGIN = 3
"""Rows and columns of zeros around the volume; strips that begin outside are moved there."""

_OPTIONS: dict[str, Any] = {"nogil": True, "fastmath": True, "error_model": "numpy", "cache": True}
_TILE = 16


@njit(inline="always")
def _floor(number):
    """Round down what is not below −2¹⁶, without a call."""
    return np.int64(np.float64(number) + 65536.0) - 65536


@njit(inline="always")
def _most_whole(length):
    """How many whole numbers apart the ends of an interval may be, rounded outwards."""
    return np.int64(length) + 2


@njit(inline="always")
def _within(first, count, most):
    """Return the first and the number of the neighbours whose vectors meet 0 … most − 1, none if there are none."""
    first = max(first, -PAD)
    if first >= most:
        return most, 0
    if count <= UNROLLED:  # as many as for the vectors beside, so that the processor guesses right
        return min(first, most - count), count
    return first, min(count, most - first)


@njit(inline="always")
def _scratch(window):
    """What is known of the strips of a chunk: columns and weights, sums over slices, numbers, edges."""
    return (
        np.empty((CHUNK, WIDTH), np.int32),
        np.empty((CHUNK, TAPS, WIDTH), np.float32),
        np.zeros(CHUNK * (window + 2 * PAD), np.float32),
        np.empty((CHUNK, 4), np.int64),
        np.empty((CHUNK, 2), np.float32),
    )


@njit(inline="always", **_OPTIONS)
def _prepare(lines, cells, heights, shape, leftmost, rightmost, strip, last, row, count, scratch):
    """Weigh up to CHUNK strips that meet `count` rows between two columns; return the next strip and how many.

    Of each strip are noted its number, its first slice, its vectors of slices, and whether it covers three columns;
    the first edge of its detector rows, from that slice on, and their step.
    """
    edge, slope, width, widening, _ = lines
    view, part, change, parts = cells
    low, rise, step, rows = heights
    height, cols, slices = shape
    column, weight, _, notes, edges = scratch
    top = np.float32(row) - np.float32((height - 1) * 0.5)
    bottom = top + np.float32(count - 1)
    middle = (top + bottom) * np.float32(0.5)
    found = 0
    while strip < last and found < CHUNK:
        left0, left1 = edge[strip] + slope[strip] * top, edge[strip] + slope[strip] * bottom
        wide0, wide1 = width[strip] + widening[strip] * top, width[strip] + widening[strip] * bottom
        if max(left0 + wide0, left1 + wide1) > leftmost and min(left0, left1) < rightmost:
            cell = strip // parts
            seen = view[cell]
            t = np.float64(part[cell] + change[cell] * middle)
            begin, between = low[seen] + t * rise[seen], t * step
            end = begin + rows * between
            if end > 0 and begin < slices and between > 0:
                first = (np.int64(max(begin, 0.0)) // WIDTH) * WIDTH
                vectors = (min(np.int64(end) + 1, slices) - first + WIDTH - 1) // WIDTH
                notes[found, 0], notes[found, 1], notes[found, 2] = strip, first, vectors
                notes[found, 3] = max(wide0, wide1) > np.float32(1)
                edges[found, 0], edges[found, 1] = np.float32(begin - first), np.float32(between)
                weigh(edge, slope, width, widening, strip, top, np.float32(cols), column, weight, found)
                found += 1
        strip += 1
    return strip, found


@njit(**_OPTIONS)
def project(volume, steps, lines, cells, heights, shape, reach, together, window, rays, first, last):
    """Sum the volume [row][column][slice] along the strips first … last − 1 into rays [cell][detector row].

    Args:
        volume: All of it in one dimension.
        steps: Its first element, and the steps to the next row and to the next column, of the frame of the strips.
        lines: The strips.
        cells: For each cell its view, the part t and its change; strips per cell.
        heights: Of each view, `ViewHeights`; and the detector rows.
        shape: Rows, columns, and slices.
        reach: On each block of rows the volume is 0 outside the columns reach[block, 0] … reach[block, 1] − 1.
        together: Rows that share one t.
        window: Most slices that a ray may meet in them.
        rays: All of them in one dimension.
        first: Strips, whole cells.
        last: Strips.
    """
    origin, row_step, column_step = steps
    high = (heights[3] + WIDTH - 1) // WIDTH * WIDTH
    scratch = _scratch(window)
    column, weight, sums, notes, edges = scratch
    long, long_ray = window + 2 * PAD, high + PAD
    rays[first // cells[3] * long_ray + PAD : last // cells[3] * long_ray + PAD] = 0
    for row in range(0, shape[0], together):
        count = min(together, shape[0] - row)
        leftmost, rightmost = reach[row // together]
        if leftmost >= rightmost:
            continue
        start, strip = origin + row * row_step, first
        while strip < last:
            strip, found = _prepare(lines, cells, heights, shape, leftmost, rightmost, strip, last, row, count, scratch)
            for slot in range(found):
                for piece in range(0, notes[slot, 2], UNROLLED):
                    vectors = min(notes[slot, 2] - piece, UNROLLED)
                    at, to = start + notes[slot, 1] + piece * WIDTH, slot * long + PAD + piece * WIDTH
                    if notes[slot, 3]:
                        gather3(volume, at, row_step, column_step, column, weight, slot, count, sums, to, vectors)
                    else:
                        gather2(volume, at, row_step, column_step, column, weight, slot, count, sums, to, vectors)
            for slot in range(found):
                edge, step = edges[slot, 0], edges[slot, 1]
                ray, most = notes[slot, 0] // cells[3] * long_ray + PAD, notes[slot, 2] * WIDTH
                lean = np.float32(WIDTH - 1) * (step - np.float32(1))
                neighbours = _most_whole(abs(lean) + step)
                for number in range(0, high, WIDTH):
                    begin = edge + np.float32(number) * step
                    k, count_k = _within(_floor(min(begin, begin + lean)), neighbours, most)
                    if count_k > 0:
                        at = slot * long + PAD
                        to_rows(sums, at, begin, step, np.float32(1) / step, k, count_k, rays, ray + number)


@njit(**_OPTIONS)
def back_project(volume, steps, lines, cells, heights, shape, reach, together, window, rays, power, first, last):
    """Transpose of `project`, for the rows first … last − 1; with two powers, of the squared weights.

    Outside the columns of `reach` the volume is not complete.
    """
    origin, row_step, column_step = steps
    high = (heights[3] + WIDTH - 1) // WIDTH * WIDTH
    scratch = _scratch(window)
    column, weight, sums, notes, edges = scratch
    long, long_ray, strips = window + 2 * PAD, high + PAD, len(lines[0])
    for row in range(first, last, together):
        count = min(together, last - row)
        leftmost, rightmost = reach[row // together]
        if leftmost >= rightmost:
            continue
        start, strip = origin + row * row_step, 0
        while strip < strips:
            strip, found = _prepare(
                lines, cells, heights, shape, leftmost, rightmost, strip, strips, row, count, scratch
            )
            for slot in range(found):
                edge, step = edges[slot, 0], edges[slot, 1]
                ray, inverse = notes[slot, 0] // cells[3] * long_ray + PAD, np.float32(1) / step
                lean = np.float32(WIDTH - 1) * (inverse - np.float32(1))
                neighbours = _most_whole(abs(lean) + inverse)
                scale = inverse * inverse if len(power) == 2 else inverse
                for number in range(0, notes[slot, 2] * WIDTH, WIDTH):
                    begin = (np.float32(number) - edge) * inverse
                    k, count_k = _within(_floor(min(begin, begin + lean)), neighbours, high)
                    begin, to = edge - np.float32(number), slot * long + PAD + number
                    to_slices(rays, ray, begin, step, scale, k, count_k, sums, to, power)
            for slot in range(found):
                for piece in range(0, notes[slot, 2], UNROLLED):
                    vectors = min(notes[slot, 2] - piece, UNROLLED)
                    at, source = start + notes[slot, 1] + piece * WIDTH, slot * long + PAD + piece * WIDTH
                    if notes[slot, 3]:
                        scatter3(
                            volume, at, row_step, column_step, column, weight, slot, count, sums, source, vectors, power
                        )
                    else:
                        scatter2(
                            volume, at, row_step, column_step, column, weight, slot, count, sums, source, vectors, power
                        )
