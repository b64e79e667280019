"""The vector instructions of a cone beam's projector, for kernels compiled by numba.

A volume is stored as [row][column][slice] and rays as [cell][detector row]: the weights of a strip seen along the axis
serve all slices. A few rows of the image, over which the ray hardly rises, are summed first (*gather*); then the slices
of the sum are averaged between the edges of the detector rows, by `overlap_kernels`. The transpose goes the same way
back, and ends here (*scatter*). Both work on the slices that the rays meet, in vectors from multiples of eight on.


numba's cache on disk looks at the file of a kernel alone: after a change here, delete the `__pycache__` folder.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from pnpct.operators.vector_ir import INT, LONG, Vector, element, times

WIDTH = 8
"""Slices or detector rows in a vector."""

CHUNK = 32
"""Strips treated before their weights are used: reading immediately what was just written would stall."""

PAD = 8
"""Zeros before and after the slices or the rows of a ray."""

NARROWEST = 1e-6
"""Columns. Behind the focal spot, always beside the image, the lines of a strip cross and its width is negative."""

UNROLLED = 8
"""There is code for each number of vectors of slices, summed in registers, and of neighbours, up to this."""

TAPS = 3
"""Columns that a strip may cover."""

ALIGN = 4 * WIDTH
"""Bytes."""


@intrinsic
def weigh(_, edge, slope, width, widening, strip, row, cols, column, weight, slot):
    """Write column[slot, r] and weight[slot, tap, r] of a strip on WIDTH rows of the image that begin at `row`."""
    signature = types.void(edge, slope, width, widening, strip, row, cols, column, weight, slot)

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> Any:
        vector, whole = Vector(builder, WIDTH), ir.VectorType(INT, WIDTH)
        strip, row, cols, column, weight, slot = args[4:]
        edge, slope, width, widening = (
            vector.fill(builder.load(element(context, builder, signature.args[number], args[number], strip)))
            for number in range(4)
        )
        zero, one = (vector.constant([value] * WIDTH) for value in (0, 1))
        numbers = vector.add(vector.fill(row), vector.constant(range(WIDTH)))
        left = vector.add(edge, vector.mul(slope, numbers))
        wide = vector.add(width, vector.mul(widening, numbers))
        wide = vector.call("maxnum", wide, vector.constant([NARROWEST] * WIDTH))
        first = vector.clip(vector.call("floor", left), vector.constant([-1] * WIDTH), vector.fill(cols))
        target = element(context, builder, signature.args[7], column, times(builder, slot, WIDTH))
        builder.store(builder.fptosi(first, whole), builder.bitcast(target, whole.as_pointer()), align=4)
        right = vector.sub(vector.add(left, wide), first)
        share = builder.fdiv(one, wide, flags=("arcp", "contract"))
        parts = [one]
        for tap in range(1, TAPS):
            part = vector.mul(vector.sub(right, vector.constant([tap] * WIDTH)), share)
            parts.append(vector.clip(part, zero, one))
        target = element(context, builder, signature.args[8], weight, times(builder, slot, WIDTH * TAPS))
        for tap, part in enumerate(parts):
            value = vector.sub(part, parts[tap + 1]) if tap + 1 < TAPS else part
            vector.store(value, builder.gep(target, [ir.Constant(LONG, tap * WIDTH)]), 4)
        return context.get_dummy_value()

    return signature, generate


def for_each_count(
    builder: ir.IRBuilder, count: Any, body: Callable[[int], None], otherwise: Callable[[], None] = lambda: None
) -> None:
    """Branch to the code for a count of 1, 2, … UNROLLED, or to that for another."""
    end, other = builder.append_basic_block("counted"), builder.append_basic_block("otherwise")
    switch = builder.switch(count, other)
    for number in range(1, UNROLLED + 1):
        block = builder.append_basic_block(f"count{number}")
        switch.add_case(ir.Constant(count.type, number), block)
        builder.position_at_end(block)
        body(number)
        builder.branch(end)
    builder.position_at_end(other)
    otherwise()
    builder.branch(end)
    builder.position_at_end(end)


class _Steps:
    """The rows of the image that a strip crosses: pointers to the first slice under each tap, and its weight."""

    def __init__(self, context: Any, builder: ir.IRBuilder, kinds: Any, args: Any, taps: int) -> None:
        volume, start, self.row_step, self.column_step, column, weight, slot, self.rows = args
        self.builder, self.taps = builder, taps
        self.base = element(context, builder, kinds[0], volume, start)
        self.column = element(context, builder, kinds[4], column, times(builder, slot, WIDTH))
        self.weight = element(context, builder, kinds[5], weight, times(builder, slot, WIDTH * TAPS))

    @contextmanager
    def each(self) -> Iterator[list[tuple[Any, Any]]]:
        builder = self.builder
        with cgutils.for_range(builder, self.rows) as loop:
            column = builder.sext(builder.load(builder.gep(self.column, [loop.index])), LONG)
            offset = builder.add(builder.mul(loop.index, self.row_step), builder.mul(column, self.column_step))
            taps = []
            for tap in range(self.taps):
                at = builder.gep(self.weight, [builder.add(loop.index, ir.Constant(LONG, tap * WIDTH))])
                taps.append((builder.gep(self.base, [offset]), builder.load(at)))
                offset = builder.add(offset, self.column_step)
            yield taps


def _gather(taps: int) -> Callable[..., None]:
    @intrinsic
    def gather(_, volume, start, row_step, column_step, column, weight, slot, rows, target, at, count):
        """Write to target[at …] the sum over the rows of `count` vectors of slices, and zeros after it."""
        signature = types.void(volume, start, row_step, column_step, column, weight, slot, rows, target, at, count)

        def generate(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> Any:
            vector = Vector(builder, WIDTH)
            zero = vector.constant([0] * WIDTH)
            target = element(context, builder, signature.args[8], args[8], args[9])

            def body(number: int) -> None:
                sums = [cgutils.alloca_once(builder, vector.type) for _ in range(number)]
                for each in sums:
                    builder.store(zero, each)
                with _Steps(context, builder, signature.args, args[:8], taps).each() as steps:
                    for source, factor in steps:
                        filled = vector.fill(factor)
                        for piece, each in enumerate(sums):
                            value = vector.load(builder.gep(source, [ir.Constant(LONG, piece * WIDTH)]), ALIGN)
                            builder.store(vector.add(builder.load(each), vector.mul(filled, value)), each)
                for piece, each in enumerate([*map(builder.load, sums), zero]):
                    vector.store(each, builder.gep(target, [ir.Constant(LONG, piece * WIDTH)]), 4)

            for_each_count(builder, args[10], body)
            return context.get_dummy_value()

        return signature, generate

    return gather


def _scatter(taps: int) -> Callable[..., None]:
    @intrinsic
    def scatter(_, volume, start, row_step, column_step, column, weight, slot, rows, source, at, count, power):
        """Add `count` vectors of slices from source[at …] to the columns under a strip, by weights to the power."""
        squared = power.count == 2
        signature = types.void(
            volume, start, row_step, column_step, column, weight, slot, rows, source, at, count, power
        )

        def generate(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> Any:
            vector = Vector(builder, WIDTH)
            source = element(context, builder, signature.args[8], args[8], args[9])

            def body(number: int) -> None:
                values = [
                    vector.load(builder.gep(source, [ir.Constant(LONG, piece * WIDTH)]), 4) for piece in range(number)
                ]
                with _Steps(context, builder, signature.args, args[:8], taps).each() as steps:
                    for target, factor in steps:
                        filled = vector.fill(builder.fmul(factor, factor) if squared else factor)
                        for piece, value in enumerate(values):
                            place = builder.gep(target, [ir.Constant(LONG, piece * WIDTH)])
                            total = vector.add(vector.load(place, ALIGN), vector.mul(filled, value))
                            vector.store(total, place, ALIGN)

            for_each_count(builder, args[10], body)
            return context.get_dummy_value()

        return signature, generate

    return scatter


gather2, gather3 = _gather(2), _gather(3)
scatter2, scatter3 = _scatter(2), _scatter(3)
