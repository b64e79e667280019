"""Shorthand for vector instructions in numba intrinsics.

numba's cache on disk looks at the file of a kernel alone: after a change here, delete the `__pycache__` folder.
"""

from typing import Any

from llvmlite import ir
from numba.core import cgutils

FREE = ("nnan", "ninf", "nsz", "arcp", "contract")
"""Fused multiply-add and no care for NaN, but no reassociation: it would merge the sums that hide latency."""

FLOAT, INT, LONG = ir.FloatType(), ir.IntType(32), ir.IntType(64)


class Vector:
    """Shorthand for <size x float> instructions on an LLVM builder."""

    def __init__(self, builder: ir.IRBuilder, size: int) -> None:
        self.builder, self.size, self.type = builder, size, ir.VectorType(FLOAT, size)

    def constant(self, values: Any) -> Any:
        return ir.Constant(self.type, [ir.Constant(FLOAT, float(value)) for value in values])

    def fill(self, scalar: Any) -> Any:
        """Every element equal to a scalar."""
        return fill(self.builder, scalar, self.size)

    def load(self, pointer: Any, align: int) -> Any:
        return self.builder.load(self.builder.bitcast(pointer, self.type.as_pointer()), align=align)

    def store(self, value: Any, pointer: Any, align: int) -> None:
        self.builder.store(value, self.builder.bitcast(pointer, self.type.as_pointer()), align=align)

    def add(self, a: Any, b: Any) -> Any:
        return self.builder.fadd(a, b, flags=FREE)

    def sub(self, a: Any, b: Any) -> Any:
        return self.builder.fsub(a, b, flags=FREE)

    def mul(self, a: Any, b: Any) -> Any:
        return self.builder.fmul(a, b, flags=FREE)

    def call(self, name: str, *operands: Any) -> Any:
        signature = ir.FunctionType(self.type, [self.type] * len(operands))
        function = cgutils.get_or_insert_function(self.builder.module, signature, f"llvm.{name}.v{self.size}f32")
        return self.builder.call(function, operands, fastmath=FREE)

    def clip(self, value: Any, low: Any, high: Any) -> Any:
        return self.call("minnum", self.call("maxnum", value, low), high)


def fill(builder: ir.IRBuilder, scalar: Any, size: int) -> Any:
    blank = ir.Constant(ir.VectorType(scalar.type, size), ir.Undefined)
    first = builder.insert_element(blank, scalar, ir.Constant(INT, 0))
    return builder.shuffle_vector(first, blank, ir.Constant(ir.VectorType(INT, size), [0] * size))


def element(context: Any, builder: ir.IRBuilder, array_type: Any, array: Any, *terms: Any) -> Any:
    """Pointer to an element of an array: base plus the sum of the terms."""
    pointer = cgutils.create_struct_proxy(array_type)(context, builder, value=array).data
    for term in terms:
        pointer = builder.gep(pointer, [ir.Constant(LONG, term) if isinstance(term, int) else term])
    return pointer


def times(builder: ir.IRBuilder, a: Any, factor: int) -> Any:
    return builder.mul(a, ir.Constant(LONG, factor))
