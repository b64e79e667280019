"""The projector's inner loops on a CPU, compiled by numba.

An image is stored as [row][column][lane] and rays as [strip][lane], so that one load, one index and one weight serve
all lanes. LLVM does not find this by itself; the three `@intrinsic`s below write the vector instructions of the
innermost steps: the columns and weights of one strip on a block of rows, the sum over them, and its transpose.

A strip that covers columns e … e + w on a row, with i = ⌊e⌋, has the mean

    p[i] + c₁ (p[i+1] − p[i]) + c₂ (p[i+2] − p[i+1]),     c_t = (e + w − i − t) / w cut to [0, 1].

The lane count reaches the compiler as the length of a tuple: numba caches one kernel on disk for each length.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from llvmlite.binding import get_host_cpu_features
from numba import njit, types
from numba.extending import intrinsic

from pnpct.operators.ray_lines import LEFT, NARROWEST, TAPS
from pnpct.operators.vector_ir import FREE, INT, LONG, Vector, element, fill, times

BLOCK = 64
"""Images have rows in multiples of this."""

CHUNK = 32
"""Strips treated before their weights are used: reading immediately what was just written would stall."""


_TALLEST, _SHARED = (BLOCK, 256) if get_host_cpu_features().get("avx512f") else (32, 512)
"""Rows of a block at most, and rows times lanes. Shorter vectors lose less to rows beyond the end of a strip."""


def rows_together(lanes: int) -> int:
    """Rows treated together: many, to share what a strip costs, but so few that they stay in the nearest caches."""
    return max(16, min(_TALLEST, _SHARED // lanes))


@njit(inline="always")
def _height(lanes):
    return max(16, min(_TALLEST, _SHARED // len(lanes)))


def _weigh(taps: int) -> Callable[..., None]:
    @intrinsic
    def weigh(_, edge, slope, width, widening, strip, row, cols, stride, place, weight, slot, lanes):
        """Write place[slot, r] and weight[slot, t, r] of a strip on the rows of a block that begins at `row`."""
        size, rows = lanes.count, rows_together(lanes.count)
        signature = types.void(edge, slope, width, widening, strip, row, cols, stride, place, weight, slot, lanes)

        def generate(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> Any:
            vector, whole = Vector(builder, rows), ir.VectorType(INT, rows)
            strip, row, cols, stride, place, weight, slot = args[4:11]
            edge, slope, width, widening = (
                vector.fill(builder.load(element(context, builder, signature.args[number], args[number], strip)))
                for number in range(4)
            )
            numbers = vector.add(vector.fill(row), vector.constant(range(rows)))
            left = vector.add(edge, vector.mul(slope, numbers))
            wide = vector.add(width, vector.mul(widening, numbers))
            wide = vector.call("maxnum", wide, vector.constant([NARROWEST] * rows))
            first = vector.clip(vector.call("floor", left), vector.constant([-LEFT] * rows), vector.fill(cols))
            column = builder.add(builder.fptosi(first, whole), ir.Constant(whole, [LEFT] * rows))
            down = builder.mul(fill(builder, stride, rows), ir.Constant(whole, list(range(rows))))
            offset = builder.add(builder.mul(column, ir.Constant(whole, [size] * rows)), down)
            target = element(context, builder, signature.args[8], place, times(builder, slot, rows))
            builder.store(offset, builder.bitcast(target, whole.as_pointer()), align=4)
            right = vector.sub(vector.add(left, wide), first)
            share = builder.fdiv(vector.constant([1] * rows), wide, flags=FREE)
            target = element(context, builder, signature.args[9], weight, times(builder, slot, rows * (TAPS - 1)))
            for tap in range(1, taps):
                part = vector.mul(vector.sub(right, vector.constant([tap] * rows)), share)
                part = vector.call("maxnum", part, vector.constant([0] * rows))  # above 1 only beside the image
                vector.store(part, builder.gep(target, [ir.Constant(LONG, (tap - 1) * rows)]), 4)
            return context.get_dummy_value()

        return signature, generate

    return weigh


def _steps(context: Any, builder: ir.IRBuilder, signature: Any, args: Any, taps: int, lanes: Any) -> Any:
    """Pointers to the first column and the tap weights on each row, and to the lanes of the strip."""
    image, row_start, place, weight, slot, rays, strip = args[:7]
    size, rows = lanes.count, rows_together(lanes.count)
    base = element(context, builder, signature.args[0], image, row_start)
    places = element(context, builder, signature.args[2], place, times(builder, slot, rows))
    weights = element(context, builder, signature.args[3], weight, times(builder, slot, rows * (TAPS - 1)))

    def step(row: int) -> tuple[Any, list[Any]]:
        offset = builder.load(builder.gep(places, [ir.Constant(LONG, row)]))
        parts = [builder.load(builder.gep(weights, [ir.Constant(LONG, tap * rows + row)])) for tap in range(taps - 1)]
        return builder.gep(base, [builder.sext(offset, LONG)]), parts

    return step, element(context, builder, signature.args[5], rays, times(builder, strip, size))


def _together(taps: int, size: int) -> int:
    """Taps that one vector of at most 16 floats holds, 1 if they do not fit."""
    padded = 2 if taps == 2 else 4
    return padded if padded * size <= 16 else 1


def _spread(vector: Vector, parts: list[Any], taps: int, size: int) -> Any:
    """Return the weights 1 − c₁, c₁ − c₂, c₂ (, 0) of all taps, each over its lanes, in one vector."""
    at = lambda tap, sign: [sign * (element // size == tap) for element in range(vector.size)]  # noqa: E731
    total = vector.constant(at(0, 1))
    for tap in range(1, taps):
        change = [a + b for a, b in zip(at(tap, 1), at(tap - 1, -1), strict=True)]
        total = vector.add(total, vector.mul(vector.fill(parts[tap - 1]), vector.constant(change)))
    return total


def _gather(taps: int) -> Callable[..., None]:
    @intrinsic
    def gather(_, image, row_start, place, weight, slot, rays, strip, lanes):
        """Add the means under a strip on a block of rows to rays[strip]."""
        size = lanes.count
        signature = types.void(image, row_start, place, weight, slot, rays, strip, lanes)

        def generate(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> Any:
            step, target = _steps(context, builder, signature, args, taps, lanes)
            lane, align = Vector(builder, size), 4 * size
            together = _together(taps, size)
            sums: list[Any] = [None] * 4
            if together > 1:
                vector = Vector(builder, together * size)
                for row in range(rows_together(lanes.count)):
                    source, parts = step(row)
                    term = vector.mul(vector.load(source, align), _spread(vector, parts, taps, size))
                    sums[row % 4] = term if row < 4 else vector.add(sums[row % 4], term)
                total = vector.add(vector.add(sums[0], sums[1]), vector.add(sums[2], sums[3]))
                places = (list(range(tap * size, (tap + 1) * size)) for tap in range(together))
                pieces = [
                    builder.shuffle_vector(total, total, ir.Constant(ir.VectorType(INT, size), at)) for at in places
                ]
                result = lane.load(target, align)
                for piece in pieces:
                    result = lane.add(result, piece)
            else:
                for row in range(rows_together(lanes.count)):
                    source, parts = step(row)
                    values = [
                        lane.load(builder.gep(source, [ir.Constant(LONG, tap * size)]), align) for tap in range(taps)
                    ]
                    term = values[0]
                    for tap in range(1, taps):
                        rise = lane.sub(values[tap], values[tap - 1])
                        term = lane.add(term, lane.mul(lane.fill(parts[tap - 1]), rise))
                    sums[row % 4] = term if row < 4 else lane.add(sums[row % 4], term)
                total = lane.add(lane.add(sums[0], sums[1]), lane.add(sums[2], sums[3]))
                result = lane.add(lane.load(target, align), total)
            lane.store(result, target, align)
            return context.get_dummy_value()

        return signature, generate

    return gather


def _scatter(taps: int) -> Callable[..., None]:
    @intrinsic
    def scatter(_, image, row_start, place, weight, slot, rays, strip, length, power, lanes):
        """Add rays[strip] times length to the columns under the strip on a block of rows, by weights to the power."""
        size, squared = lanes.count, power.count == 2
        signature = types.void(image, row_start, place, weight, slot, rays, strip, length, power, lanes)

        def generate(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> Any:
            step, origin = _steps(context, builder, signature, args, taps, lanes)
            lane, align = Vector(builder, size), 4 * size
            value = lane.mul(lane.load(origin, align), lane.fill(args[7]))
            together = _together(taps, size)
            if together > 1:
                vector = Vector(builder, together * size)
                repeat = ir.Constant(ir.VectorType(INT, vector.size), [e % size for e in range(vector.size)])
                values = builder.shuffle_vector(value, value, repeat)
                for row in range(rows_together(lanes.count)):
                    target, parts = step(row)
                    factor = _spread(vector, parts, taps, size)
                    factor = vector.mul(factor, factor) if squared else factor
                    vector.store(vector.add(vector.load(target, align), vector.mul(values, factor)), target, align)
                return context.get_dummy_value()
            for row in range(rows_together(lanes.count)):
                target, parts = step(row)
                filled = [lane.constant([1] * size), *[lane.fill(part) for part in parts]]
                for tap in range(taps):
                    factor = lane.sub(filled[tap], filled[tap + 1]) if tap + 1 < taps else filled[tap]
                    factor = lane.mul(factor, factor) if squared else factor
                    column = builder.gep(target, [ir.Constant(LONG, tap * size)])
                    lane.store(lane.add(lane.load(column, align), lane.mul(value, factor)), column, align)
            return context.get_dummy_value()

        return signature, generate

    return scatter


_weigh2, _weigh3 = _weigh(2), _weigh(3)
_gather2, _gather3 = _gather(2), _gather(3)
_scatter2, _scatter3 = _scatter(2), _scatter(3)

_OPTIONS: dict[str, Any] = {"nogil": True, "fastmath": True, "error_model": "numpy", "cache": True}

# Unsigned numbers, because a signed one would be checked for counting from the end at each use.
_ZERO, _ONE, _CHUNK = np.uint64(0), np.uint64(1), np.uint64(CHUNK)


@njit(inline="always", **_OPTIONS)
def _prepare(lines, strip, last, top, cols, leftmost, rightmost, stride, place, weight, strips, wide, lanes):
    """Weigh up to CHUNK strips that meet a block of rows between two columns; return the next strip and how many."""
    edge, slope, width, widening, _ = lines
    count = _ZERO
    bottom = top + np.float32(_height(lanes) - 1)
    while strip < last and count < _CHUNK:
        left0, left1 = edge[strip] + slope[strip] * top, edge[strip] + slope[strip] * bottom
        wide0, wide1 = width[strip] + widening[strip] * top, width[strip] + widening[strip] * bottom
        if max(left0 + wide0, left1 + wide1) > leftmost and min(left0, left1) < rightmost:
            strips[count] = strip
            wide[count] = max(wide0, wide1) > np.float32(1)
            if wide[count]:
                _weigh3(edge, slope, width, widening, strip, top, cols, stride, place, weight, count, lanes)
            else:
                _weigh2(edge, slope, width, widening, strip, top, cols, stride, place, weight, count, lanes)
            count += _ONE
        strip += _ONE
    return strip, count


@njit(inline="always")
def _scratch(lanes):
    """Places and weights of a chunk of strips, their numbers, and whether they take three taps."""
    rows = _height(lanes)
    return (
        np.empty((CHUNK, rows), np.int32),
        np.empty((CHUNK, TAPS - 1, rows), np.float32),
        np.empty(CHUNK, np.uint64),
        np.empty(CHUNK, np.bool_),
    )


@njit(**_OPTIONS)
def project(image, lines, rays, rows, cols, reach, lanes, first, last):
    """Sum the image [row][column][lane] along the strips first … last − 1 into rays [strip][lane].

    On a block of rows the image is 0 outside the columns reach[block, 0] … reach[block, 1] − 1.
    """
    place, weight, strips, wide = _scratch(lanes)
    stride, end = np.int32(image.shape[1] * len(lanes)), np.uint64(last)
    middle, right = np.float32((rows - 1) * 0.5), np.float32(cols)
    rays[first:last] = 0
    for row in range(0, image.shape[0], _height(lanes)):
        leftmost, rightmost = reach[row // _height(lanes)]
        if leftmost >= rightmost:
            continue
        strip, start, top = np.uint64(first), row * np.int64(stride), np.float32(row) - middle
        while strip < end:
            strip, count = _prepare(
                lines, strip, end, top, right, leftmost, rightmost, stride, place, weight, strips, wide, lanes
            )
            for slot in range(count):
                if wide[slot]:
                    _gather3(image, start, place, weight, slot, rays, strips[slot], lanes)
                else:
                    _gather2(image, start, place, weight, slot, rays, strips[slot], lanes)
    for number in range(first, last):
        for lane in range(len(lanes)):
            rays[number, lane] *= lines[4][number]


@njit(**_OPTIONS)
def back_project(image, lines, rays, rows, cols, reach, power, lanes, first, last):
    """Transpose of `project`, for the rows first … last − 1; with two powers, of the squared weights.

    Outside the columns of `reach` the image is not complete.
    """
    place, weight, strips, wide = _scratch(lanes)
    stride, end = np.int32(image.shape[1] * len(lanes)), np.uint64(rays.shape[0])
    middle, right = np.float32((rows - 1) * 0.5), np.float32(cols)
    image[first:last] = 0
    for row in range(first, last, _height(lanes)):
        leftmost, rightmost = reach[row // _height(lanes)]
        if leftmost >= rightmost:
            continue
        strip, start, top = _ZERO, row * np.int64(stride), np.float32(row) - middle
        while strip < end:
            strip, count = _prepare(
                lines, strip, end, top, right, leftmost, rightmost, stride, place, weight, strips, wide, lanes
            )
            for slot in range(count):
                number = strips[slot]
                length = lines[4][number] * lines[4][number] if len(power) == 2 else lines[4][number]
                if wide[slot]:
                    _scatter3(image, start, place, weight, slot, rays, number, length, power, lanes)
                else:
                    _scatter2(image, start, place, weight, slot, rays, number, length, power, lanes)
