"""The inner loops of a cone beam's filtered back-projection on a CPU: voxel-driven, compiled by numba.

Between two bins all rows are interpolated first, then between the rows for eight slices together: slice i takes row
i + k, for each k that one of the eight may need, with the share |[h, h + 1] ∩ [i + k, i + k + 1]| at the height h.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic

from pnpct.operators.cone.cone_kernels import PAD, WIDTH
from pnpct.operators.cone.overlap_kernels import overlap_sums
from pnpct.operators.fan_kernels import BLOCK, seen_from
from pnpct.operators.vector_ir import Vector, element

_OPTIONS: dict[str, Any] = {"nogil": True, "fastmath": True, "error_model": "numpy", "cache": True}
_TILE, _FAR = 16, 1 << 16


@intrinsic
def _add_between_rows(_, line, at, height, step, top, first, count, image, voxel):
    """Add to WIDTH slices from image[voxel] on the values of line[at …] at height + i step, within 0 … top."""
    signature = types.void(line, at, height, step, top, first, count, image, voxel)

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> Any:
        line, at, height, step, top, first, count, image, voxel = args
        vector = Vector(builder, WIDTH)
        numbers, zero, one = (vector.constant(values) for values in (range(WIDTH), [0] * WIDTH, [1] * WIDTH))
        heights = vector.add(vector.fill(height), vector.mul(numbers, vector.fill(step)))
        low = vector.sub(vector.clip(heights, zero, vector.fill(top)), numbers)
        high = vector.add(low, one)
        source = element(context, builder, signature.args[0], line, at)
        (total,) = overlap_sums(builder, [source], first, count, lambda k: vector.clip(k, low, high), squared=False)
        target = element(context, builder, signature.args[7], image, voxel)
        vector.store(vector.add(vector.load(target, 4), total), target, 4)
        return context.get_dummy_value()

    return signature, generate


@njit(**_OPTIONS)
def pack_views(rays, packed, first, last):
    """Fill views first … last − 1 of [view][1 + bin + 2][row] from [view][row][bin]."""
    _, rows, bins = rays.shape
    for view in range(first, last):
        packed[view] = 0
        for bin0 in range(0, bins, _TILE):
            for row in range(rows):
                for number in range(bin0, min(bin0 + _TILE, bins)):
                    packed[view, number + 1, row] = rays[view, row, number]


@njit(**_OPTIONS)
def back_project_cone(image, views, cosines, sines, heights, place, distance, bins, arc, first, last):
    """Add the filtered views [view][1 + bin + 2][row] to the rows first … last − 1 of image [row][column][slice].

    `place` and `bins` are those of `back_project_fan`. A voxel of slice k is, in detector rows from the middle of the
    lowest one and seen from the distance l, at start + (low + k step)/l; `heights` is (start and low of each view,
    step). On a flat detector l is measured along the central ray. Slices are whole vectors.
    """
    x0, y0, spacing = place
    start, low, step = heights
    cols, slices = image.shape[1:]
    rows = views.shape[2]
    top = np.float32(rows - 1)
    lanes = np.float32(WIDTH - 1)
    at, share, nearness = np.empty(cols, np.int32), np.empty(cols, np.float32), np.empty(cols, np.float32)
    line = np.zeros(rows + 2 * PAD, np.float32)
    for block in range(first, last, BLOCK):
        for view in range(cosines.size):
            c, s = cosines[view], sines[view]
            for row in range(block, min(block + BLOCK, last)):
                y = y0 - np.float32(row) * spacing
                for col in range(cols):
                    at[col], share[col], squared = seen_from(
                        x0 + np.float32(col) * spacing, y, c, s, distance, bins, arc
                    )
                    nearness[col] = np.float32(1) / np.sqrt(squared)
                for col in range(cols):
                    near, part, weight = at[col], share[col], nearness[col] * nearness[col]
                    for number in range(rows):
                        a, b = views[view, near, number], views[view, near + 1, number]
                        line[PAD + number] = weight * (a + part * (b - a))
                    rise = step * nearness[col]
                    lean = lanes * (rise - np.float32(1))
                    for k in range(0, slices, WIDTH):
                        height = start[view] + low[view] * nearness[col] + np.float32(k) * rise
                        least = max(min(height, height + lean, top - lanes), -lanes)
                        most = min(max(height, height + lean, np.float32(0)), top)
                        lowest = np.int64(np.float64(least) + _FAR) - _FAR
                        neighbours = np.int64(np.float64(most) + _FAR) - _FAR + 2 - lowest
                        voxel = (row * cols + col) * slices + k
                        _add_between_rows(line, PAD, height, rise, top, lowest, neighbours, image, voxel)
