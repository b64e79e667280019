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
    weigh,
)
from pnpct.operators.cone.cone_lines import CELLS_TOGETHER
from pnpct.operators.cone.overlap_kernels import to_rows1, to_rows4, to_slices1, to_slices4

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
    """What is known of the strips of a chunk: columns and weights, sums over slices; and of groups: numbers, edges."""
    return (
        np.empty((CHUNK, WIDTH), np.int32),
        np.empty((CHUNK, TAPS, WIDTH), np.float32),
        np.zeros(CHUNK * (window + 2 * PAD), np.float32),
        np.empty((CHUNK, 6), np.int64),
        np.empty((CHUNK, 2), np.float32),
    )


@njit(inline="always", **_OPTIONS)
def _prepare(lines, cells, heights, shape, leftmost, rightmost, group, last, row, count, scratch):
    """Weigh up to CHUNK strips of groups that meet `count` rows between two columns; return the next group, how many.

    Of each group are noted the cell of the first strip, the first strip's slot and that after the last, the first
    slice, the vectors of slices, and whether strips cover three columns; the first edge of the detector rows, from that
    slice on, and their step.
    """
    edge, slope, width, widening, _ = lines
    view, part, change, first_strip, parts = cells
    low, rise, step, rows = heights
    height, cols, slices = shape
    column, weight, _, notes, edges = scratch
    top = np.float32(row) - np.float32((height - 1) * 0.5)
    bottom = top + np.float32(count - 1)
    middle = (top + bottom) * np.float32(0.5)
    found, slot = 0, 0
    while group < last and slot <= CHUNK - CELLS_TOGETHER:
        strip, end_strip = first_strip[group], first_strip[group + 1]
        left, right, widest = np.float32(np.inf), np.float32(-np.inf), np.float32(0)
        for outer in (strip, end_strip - 1):
            left0, left1 = edge[outer] + slope[outer] * top, edge[outer] + slope[outer] * bottom
            wide0, wide1 = width[outer] + widening[outer] * top, width[outer] + widening[outer] * bottom
            left, right = min(left, left0, left1), max(right, left0 + wide0, left1 + wide1)
            widest = max(widest, wide0, wide1)
        if right > leftmost and left < rightmost:
            cell = strip if parts == 1 else strip // parts
            seen = view[cell]
            t = np.float64(part[cell] + change[cell] * middle)
            begin, between = low[seen] + t * rise[seen], t * step
            end = begin + rows * between
            if end > 0 and begin < slices and between > 0:
                first = (np.int64(max(begin, 0.0)) // WIDTH) * WIDTH
                notes[found, 0], notes[found, 1], notes[found, 2] = cell, slot, slot + end_strip - strip
                notes[found, 3], notes[found, 4] = first, (min(np.int64(end) + 1, slices) - first + WIDTH - 1) // WIDTH
                notes[found, 5] = widest > np.float32(1)
                edges[found, 0], edges[found, 1] = np.float32(begin - first), np.float32(between)
                for number in range(strip, end_strip):
                    weigh(edge, slope, width, widening, number, top, np.float32(cols), column, weight, slot)
                    slot += 1
                found += 1
        group += 1
    return group, found


@njit(**_OPTIONS)
def project(volume, steps, lines, cells, heights, shape, reach, together, window, rays, first, last):
    """Sum the volume [row][column][slice] along strips, groups first … last − 1, into rays [cell][detector row].

    Args:
        volume: All of it in one dimension.
        steps: Its first element, and the steps to the next row and to the next column, of the frame of the strips.
        lines: The strips.
        cells: For each cell its view, the part t and its change; the first strip of each group that shares them, of one
            cell or of neighbours in one view, and the number of all strips; strips per cell.
        heights: Of each view, `ViewHeights`; and the detector rows.
        shape: Rows, columns, and slices.
        reach: On each block of rows the volume is 0 outside the columns reach[block, 0] … reach[block, 1] − 1.
        together: Rows that share one t.
        window: Most slices that a ray may meet in them.
        rays: All of them in one dimension.
        first: Groups, of whole cells.
        last: Groups.
    """
    origin, row_step, column_step = steps
    high = (heights[3] + WIDTH - 1) // WIDTH * WIDTH
    scratch = _scratch(window)
    column, weight, sums, notes, edges = scratch
    long, long_ray, parts = window + 2 * PAD, high + PAD, cells[4]
    beside = long_ray if parts == 1 else 0
    rays[cells[3][first] // parts * long_ray + PAD : cells[3][last] // parts * long_ray + PAD] = 0
    for row in range(0, shape[0], together):
        count = min(together, shape[0] - row)
        leftmost, rightmost = reach[row // together]
        if leftmost >= rightmost:
            continue
        start, group = origin + row * row_step, first
        while group < last:
            group, found = _prepare(lines, cells, heights, shape, leftmost, rightmost, group, last, row, count, scratch)
            for each in range(found):
                for slot in range(notes[each, 1], notes[each, 2]):
                    for piece in range(0, notes[each, 4], UNROLLED):
                        vectors = min(notes[each, 4] - piece, UNROLLED)
                        at, to = start + notes[each, 3] + piece * WIDTH, slot * long + PAD + piece * WIDTH
                        if notes[each, 5]:
                            gather3(volume, at, row_step, column_step, column, weight, slot, count, sums, to, vectors)
                        else:
                            gather2(volume, at, row_step, column_step, column, weight, slot, count, sums, to, vectors)
            for each in range(found):
                edge, step = edges[each, 0], edges[each, 1]
                ray, most = notes[each, 0] * long_ray + PAD, notes[each, 4] * WIDTH
                lean = np.float32(WIDTH - 1) * (step - np.float32(1))
                neighbours = _most_whole(abs(lean) + step)
                scale, slot = np.float32(1) / step, notes[each, 1]
                for number in range(0, high, WIDTH):
                    begin = edge + np.float32(number) * step
                    k, count_k = _within(_floor(min(begin, begin + lean)), neighbours, most)
                    if count_k <= 0:
                        continue
                    at, to = slot * long + PAD, ray + number
                    if notes[each, 2] - slot == CELLS_TOGETHER:
                        to_rows4(sums, at, long, begin, step, scale, k, count_k, rays, to, beside)
                    else:
                        for _ in range(slot, notes[each, 2]):
                            to_rows1(sums, at, long, begin, step, scale, k, count_k, rays, to, beside)
                            at, to = at + long, to + beside


@njit(**_OPTIONS)
def back_project(volume, steps, lines, cells, heights, shape, reach, together, window, rays, power, first, last):
    """Transpose of `project`, for the rows first … last − 1; with two powers, of the squared weights.

    Outside the columns of `reach` the volume is not complete.
    """
    origin, row_step, column_step = steps
    high = (heights[3] + WIDTH - 1) // WIDTH * WIDTH
    scratch = _scratch(window)
    column, weight, sums, notes, edges = scratch
    long, long_ray, groups = window + 2 * PAD, high + PAD, len(cells[3]) - 1
    beside = long_ray if cells[4] == 1 else 0
    for row in range(first, last, together):
        count = min(together, last - row)
        leftmost, rightmost = reach[row // together]
        if leftmost >= rightmost:
            continue
        start, group = origin + row * row_step, 0
        while group < groups:
            group, found = _prepare(
                lines, cells, heights, shape, leftmost, rightmost, group, groups, row, count, scratch
            )
            for each in range(found):
                edge, step = edges[each, 0], edges[each, 1]
                ray, inverse = notes[each, 0] * long_ray + PAD, np.float32(1) / step
                lean = np.float32(WIDTH - 1) * (inverse - np.float32(1))
                neighbours = _most_whole(abs(lean) + inverse)
                scale = inverse * inverse if len(power) == 2 else inverse
                for number in range(0, notes[each, 4] * WIDTH, WIDTH):
                    begin = (np.float32(number) - edge) * inverse
                    k, count_k = _within(_floor(min(begin, begin + lean)), neighbours, high)
                    begin, slot = edge - np.float32(number), notes[each, 1]
                    at, to = ray, slot * long + PAD + number
                    if notes[each, 2] - slot == CELLS_TOGETHER:
                        to_slices4(rays, at, beside, begin, step, scale, k, count_k, sums, to, long, power)
                    else:
                        for _ in range(slot, notes[each, 2]):
                            to_slices1(rays, at, beside, begin, step, scale, k, count_k, sums, to, long, power)
                            at, to = at + beside, to + long
            for each in range(found):
                for slot in range(notes[each, 1], notes[each, 2]):
                    for piece in range(0, notes[each, 4], UNROLLED):
                        vectors = min(notes[each, 4] - piece, UNROLLED)
                        at, to = start + notes[each, 3] + piece * WIDTH, slot * long + PAD + piece * WIDTH
                        if notes[each, 5]:
                            scatter3(
                                volume, at, row_step, column_step, column, weight, slot, count, sums, to, vectors, power
                            )
                        else:
                            scatter2(
                                volume, at, row_step, column_step, column, weight, slot, count, sums, to, vectors, power
                            )
