"""The inner loops of fan-beam back-projection on a CPU: pixel-driven, in lanes, compiled by numba."""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic

from pnpct.operators.vector_ir import LONG, Vector, element, times

BLOCK = 8
"""Rows that take a view together: the view then stays in the nearest cache."""

_OPTIONS: dict[str, Any] = {"nogil": True, "fastmath": True, "error_model": "numpy", "cache": True}


@intrinsic
def _add_between(_, image, start, column, views, base, place, share, weight, lanes):
    """Add to image[start + column · lanes] weight times the value between two neighbouring bins of the view at base."""
    size = lanes.count
    signature = types.void(image, start, column, views, base, place, share, weight, lanes)

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> Any:
        image, start, column, views, base, place, share, weight, _ = args
        lane, align = Vector(builder, size), 4 * size
        element_of = lambda number, array: element(context, builder, signature.args[number], array, column)  # noqa: E731
        offset = times(builder, builder.sext(builder.load(element_of(5, place)), LONG), size)
        near = element(context, builder, signature.args[3], views, base, offset)
        a = lane.load(near, align)
        b = lane.load(builder.gep(near, [ir.Constant(LONG, size)]), align)
        value = lane.add(a, lane.mul(lane.fill(builder.load(element_of(6, share))), lane.sub(b, a)))
        target = element(context, builder, signature.args[0], image, start, times(builder, column, size))
        scaled = lane.mul(lane.fill(builder.load(element_of(7, weight))), value)
        lane.store(lane.add(lane.load(target, align), scaled), target, align)
        return context.get_dummy_value()

    return signature, generate


@njit(inline="always", **_OPTIONS)
def arctangent(z):
    """Arctangent for |z| ≤ 1 to 8e-8, by the Chebyshev fit of atan(√u)/√u on [0, 1]: it vectorises."""
    u = z * z
    high = np.float32(0.099060969) + u * (
        np.float32(-0.0593671008) + u * (np.float32(0.0241661895) + u * np.float32(-0.00466877331))
    )
    low = np.float32(0.199692354) + u * (np.float32(-0.14016585) + u * high)
    return z * (np.float32(0.999999898) + u * (np.float32(-0.333319597) + u * low))


@njit(inline="always", **_OPTIONS)
def seen_from(x, y, cosine, sine, distance, bins, arc):
    """Where a view sees a pixel: the lower bin among padded ones, the share of the upper one, and L².

    `bins` is (number, scale, offset): the bin is scale · γ + offset on an arc and scale · tan γ + offset on a flat
    detector. Only float32 and int32: a loop over columns then becomes one of vectors.
    """
    count, scale, offset = bins
    depth = distance + x * sine - y * cosine
    across = x * cosine + y * sine
    tangent = min(max(across / depth, np.float32(-1)), np.float32(1))
    squared = depth * depth
    if arc:
        tangent = arctangent(tangent)
        squared += across * across
    number = min(max(scale * tangent + offset + np.float32(1), np.float32(0)), np.float32(count + 1))
    at = np.int32(number)
    return at, number - np.float32(at), squared


@njit(**_OPTIONS)
def back_project_fan(image, views, cosines, sines, place, distance, bins, arc, lanes, first, last):
    """Sum the filtered views [view][1 + bin + 1][lane] into the rows first … last − 1 of image [row][column][lane].

    `place` is (x of column 0, y of row 0, spacing) in mm, `bins` that of `seen_from`.
    """
    x0, y0, spacing = place
    cols, size = image.shape[1], len(lanes)
    at, share, weight = np.empty(cols, np.int32), np.empty(cols, np.float32), np.empty(cols, np.float32)
    image[first:last] = 0
    for block in range(first, last, BLOCK):
        for view in range(cosines.size):
            c, s = cosines[view], sines[view]
            base = view * (bins[0] + 2) * size
            for row in range(block, min(block + BLOCK, last)):
                y = y0 - np.float32(row) * spacing
                for col in range(cols):
                    at[col], share[col], squared = seen_from(
                        x0 + np.float32(col) * spacing, y, c, s, distance, bins, arc
                    )
                    weight[col] = np.float32(1) / squared
                for col in range(cols):
                    _add_between(image, row * cols * size, col, views, base, at, share, weight, lanes)
