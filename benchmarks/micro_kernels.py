"""What the machine can do at most: multiply-adds in registers, and the projector's inner step with its weights given.

The inner step is the project's own intrinsic, with the loads, stores and multiply-adds that it has there; the columns
and weights of one chunk of strips are made once, and walk over the image as a view does.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic

from pnpct.operators.lane_kernels import Array, aligned
from pnpct.operators.ray_lines import LEFT, RIGHT, TAPS
from pnpct.operators.strip_kernels import (
    BLOCK,
    CHUNK,
    _gather2,
    _gather3,
    _height,
    _scatter2,
    _scatter3,
    rows_together,
)
from pnpct.operators.vector_ir import Vector, element

CHAINS, REPEATS = 10, 64
"""Sums that hide latency and fit into registers, and steps between two visits of memory."""


@intrinsic
def _multiply_add(_, values, lanes):
    """Multiply-add `CHAINS` vectors `REPEATS` times."""
    signature = types.void(values, lanes)

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> Any:
        size = signature.args[1].count
        vector = Vector(builder, size)
        pointer = element(context, builder, signature.args[0], args[0])
        at = [element(context, builder, signature.args[0], args[0], chain * size) for chain in range(CHAINS)]
        factor = vector.fill(builder.load(pointer))
        sums = [vector.load(each, 4) for each in at]
        for _ in range(REPEATS):
            sums = [vector.add(factor, vector.mul(each, factor)) for each in sums]
        for each, place in zip(sums, at, strict=True):
            vector.store(each, place, 4)
        return context.get_dummy_value()

    return signature, generate


@njit(nogil=True, fastmath=True)
def multiply_adds(values, times, lanes):
    """Do times · `CHAINS` · `REPEATS` multiply-adds of so many lanes."""
    for _ in range(times):
        _multiply_add(values, lanes)


@njit(nogil=True, fastmath=True, error_model="numpy")
def gather_given(image, place, weight, rays, chunks, shift, turnaround, wide, lanes):
    """`project` with the weights given: `chunks` chunks of strips on every block of rows."""
    stride, last = np.int64(image.shape[1] * len(lanes)), np.uint64(rays.shape[0] // CHUNK)
    for row in range(0, image.shape[0], _height(lanes)):
        for chunk in range(chunks):
            start = row * stride + (chunk * shift % turnaround) * len(lanes)
            strip = np.uint64(chunk) % last * np.uint64(CHUNK)
            for slot in range(np.uint64(CHUNK)):
                if wide:
                    _gather3(image, start, place, weight, slot, rays, strip + slot, lanes)
                else:
                    _gather2(image, start, place, weight, slot, rays, strip + slot, lanes)


@njit(nogil=True, fastmath=True, error_model="numpy")
def scatter_given(image, place, weight, rays, chunks, shift, turnaround, wide, lanes):
    """`back_project` with the weights given."""
    stride, last = np.int64(image.shape[1] * len(lanes)), np.uint64(rays.shape[0] // CHUNK)
    length, power = np.float32(1), (0.0,)
    for row in range(0, image.shape[0], _height(lanes)):
        for chunk in range(chunks):
            start = row * stride + (chunk * shift % turnaround) * len(lanes)
            strip = np.uint64(chunk) % last * np.uint64(CHUNK)
            for slot in range(np.uint64(CHUNK)):
                number = strip + slot
                if wide:
                    _scatter3(image, start, place, weight, slot, rays, number, length, power, lanes)
                else:
                    _scatter2(image, start, place, weight, slot, rays, number, length, power, lanes)


def given(side: int, width: float, slope: float, lanes: int) -> tuple[Array, np.ndarray, np.ndarray, Array, int, int]:
    """Return an image, the columns and weights of a chunk on a block of rows, rays, and how chunks move along.

    Args:
        side: Rows and columns of the image.
        width: Columns from one strip to the next.
        slope: Columns from one row to the next.
        lanes: Numbers per pixel.
    """
    rows, height = rows_together(lanes), -(-side // BLOCK) * BLOCK
    image, rays = aligned((height, LEFT + side + RIGHT, lanes)), aligned((64 * CHUNK, lanes))
    image[:] = 1e-3
    slot, row = np.arange(CHUNK)[:, None], np.arange(rows)
    column = LEFT + np.floor(width * slot + slope * row)
    place = np.ascontiguousarray(lanes * (column + image.shape[1] * row), np.int32)
    weight = np.random.default_rng(0).random((CHUNK, TAPS - 1, rows), np.float32) / 2
    shift = max(1, round(width * CHUNK))
    return image, place, weight, rays, shift, max(1, side - int(column.max()) - TAPS)
