"""The second step of a cone beam's projector: between slices and detector rows, for kernels compiled by numba.

Slice i and row j overlap by |[i, i+1] ∩ [e_j, e_j+1]|. Eight rows j together take slice j + k, for each k that may
overlap: neighbours in memory (*to rows*), and eight slices the rows likewise (*to slices*). Strips that are neighbours
have the same overlaps.

numba's cache on disk looks at the file of a kernel alone: after a change here, delete the `__pycache__` folder.
"""

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from pnpct.operators.cone.cone_kernels import ALIGN, WIDTH, for_each_count
from pnpct.operators.cone.cone_lines import CELLS_TOGETHER
from pnpct.operators.vector_ir import FLOAT, LONG, Vector, element, times


def overlap_sums(
    builder: ir.IRBuilder, sources: list[Any], first: Any, count: Any, corner: Callable[[Any], Any], *, squared: bool
) -> list[Any]:
    """Return Σ_k w_k source[k … k + WIDTH − 1], w_k = corner(k + 1) − corner(k), over `count` k from `first` on."""
    vector = Vector(builder, WIDTH)
    one, zero = vector.constant([1] * WIDTH), vector.constant([0] * WIDTH)
    answers = [cgutils.alloca_once(builder, vector.type) for _ in sources]
    begin = vector.fill(builder.sitofp(first, FLOAT))
    sources = [builder.gep(source, [first]) for source in sources]

    def add(k: Any, before: Any, totals: list[Any], offset: Any) -> list[Any]:
        k = vector.add(k, one)
        after = corner(k)
        share = vector.sub(after, before)
        share = vector.mul(share, share) if squared else share
        values = [vector.load(builder.gep(source, [offset]), 4) for source in sources]
        sums = [vector.add(total, vector.mul(share, value)) for total, value in zip(totals, values, strict=True)]
        return [k, after, *sums]

    def store(values: list[Any], variables: list[Any]) -> None:
        for value, variable in zip(values, variables, strict=True):
            builder.store(value, variable)

    def body(number: int) -> None:
        k, before, *totals = begin, corner(begin), *[zero] * len(sources)
        for offset in range(number):
            k, before, *totals = add(k, before, totals, ir.Constant(LONG, offset))
        store(totals, answers)

    def loop() -> None:
        variables = [cgutils.alloca_once(builder, vector.type) for _ in range(2 + len(sources))]
        store([begin, corner(begin), *[zero] * len(sources)], variables)
        with cgutils.for_range(builder, count) as each:
            k, before, *totals = map(builder.load, variables)
            store(add(k, before, totals, each.index), variables)
        store([builder.load(variable) for variable in variables[2:]], answers)

    for_each_count(builder, count, body, loop)
    return [builder.load(answer) for answer in answers]


def _strides(builder: ir.IRBuilder, pointer: Any, stride: Any, members: int) -> list[Any]:
    return [builder.gep(pointer, [times(builder, stride, member)]) for member in range(members)]


def _to_rows(members: int) -> Callable[..., None]:
    @intrinsic
    def to_rows(_, sums, at, long, edge, step, scale, first, count, rays, ray, between):
        """Add to WIDTH rows rays[ray …] `scale` times the slices sums[at …], of which they have edges from `edge` on.

        The same for each neighbour: its sums begin `long` after those of the one before, its rays `between`.
        """
        signature = types.void(sums, at, long, edge, step, scale, first, count, rays, ray, between)

        def generate(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> Any:
            sums, at, long, edge, step, scale, first, count, rays, ray, between = args
            vector = Vector(builder, WIDTH)
            numbers = vector.constant(range(WIDTH))
            low = vector.sub(vector.add(vector.fill(edge), vector.mul(numbers, vector.fill(step))), numbers)
            high = vector.add(low, vector.fill(step))
            sources = _strides(builder, element(context, builder, signature.args[0], sums, at), long, members)
            totals = overlap_sums(builder, sources, first, count, lambda k: vector.clip(k, low, high), squared=False)
            targets = _strides(builder, element(context, builder, signature.args[8], rays, ray), between, members)
            for total, target in zip(totals, targets, strict=True):  # in turn: parts of one cell have the same target
                total = vector.add(vector.load(target, ALIGN), vector.mul(total, vector.fill(scale)))
                vector.store(total, target, ALIGN)
            return context.get_dummy_value()

        return signature, generate

    return to_rows


def _to_slices(members: int) -> Callable[..., None]:
    @intrinsic
    def to_slices(_, rays, ray, between, edge, step, scale, first, count, target, place, long, power):
        """Write to WIDTH slices from target[place] on `scale` times the rows rays[ray …] with edges from `edge` on.

        The same for each neighbour: its rays begin `between` after those of the one before, its slices `long`.
        """
        squared = power.count == 2
        signature = types.void(rays, ray, between, edge, step, scale, first, count, target, place, long, power)

        def generate(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> Any:
            rays, ray, between, edge, step, scale, first, count, target, place, long, _ = args
            vector = Vector(builder, WIDTH)
            numbers = vector.constant(range(WIDTH))
            zero, one, steps = vector.constant([0] * WIDTH), vector.constant([1] * WIDTH), vector.fill(step)
            begin = vector.sub(vector.add(vector.fill(edge), vector.mul(numbers, steps)), numbers)

            def corner(k: Any) -> Any:
                return vector.clip(vector.add(begin, vector.mul(k, steps)), zero, one)

            sources = _strides(builder, element(context, builder, signature.args[0], rays, ray), between, members)
            totals = overlap_sums(builder, sources, first, count, corner, squared=squared)
            places = _strides(builder, element(context, builder, signature.args[8], target, place), long, members)
            for total, each in zip(totals, places, strict=True):
                vector.store(vector.mul(total, vector.fill(scale)), each, 4)
            return context.get_dummy_value()

        return signature, generate

    return to_slices


to_rows1, to_rows4 = _to_rows(1), _to_rows(CELLS_TOGETHER)
to_slices1, to_slices4 = _to_slices(1), _to_slices(CELLS_TOGETHER)
