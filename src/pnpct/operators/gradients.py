"""Gradients of linear maps whose transpose is known."""

from collections.abc import Callable
from typing import Any

from torch import Tensor
from torch.autograd import Function

Map = Callable[[Tensor], Tensor]


def linear(array: Tensor, apply: Map, transpose: Map) -> Tensor:
    """Return `apply(array)`, whose gradient is `transpose`.

    Args:
        array: Where the map is taken.
        apply: The map, which need not be differentiable.
        transpose: Its transpose, differentiable if gradients of gradients are wanted.
    """
    answer: Tensor = _Linear.apply(array, apply, transpose)  # type: ignore[no-untyped-call]
    return answer


class _Linear(Function):
    @staticmethod
    def forward(ctx: Any, array: Tensor, apply: Map, transpose: Map) -> Tensor:
        ctx.transpose = transpose
        return apply(array.detach())

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor, None, None]:
        return ctx.transpose(gradients[0]), None, None
