"""The one abstract class of the package."""

from abc import ABC, abstractmethod
from typing import final

from jaxtyping import Float
from torch import Tensor
from typing_extensions import override

from pnpct.arrays import Support

Shape = tuple[int, ...]


class LinearOperator(ABC):
    """A linear map between arrays with fixed trailing shapes; leading dimensions are a batch.

    A subclass has `domain_shape` and `range_shape`, `forward` and `adjoint`; calling the operator checks the shape. It
    may have a `support`: pixels of an image outside which it sees nothing, and its adjoint is 0.
    Whatever is summed over an image or over its rays is summed over `domain_dims` or `range_dims`, so that it holds for
    volumes too.
    """

    domain_shape: Shape
    range_shape: Shape
    support: Support | None = None

    def __repr__(self) -> str:
        return f"<{type(self).__name__} from {self.domain_shape} to {self.range_shape}>"

    @property
    def domain_dims(self) -> Shape:
        """The dimensions of an array of the domain, counted from the last: (-2, -1) for images."""
        return tuple(range(-len(self.domain_shape), 0))

    @property
    def range_dims(self) -> Shape:
        """The dimensions of an array of the range, counted from the last: (-2, -1) for views and bins."""
        return tuple(range(-len(self.range_shape), 0))

    @abstractmethod
    def forward(self, x: Float[Tensor, "..."]) -> Float[Tensor, "..."]:
        """Apply the operator."""

    @abstractmethod
    def adjoint(self, y: Float[Tensor, "..."]) -> Float[Tensor, "..."]:
        """Apply the transpose, for which ⟨forward x, y⟩ = ⟨x, adjoint y⟩."""

    @final
    def __call__(self, x: Float[Tensor, "..."]) -> Float[Tensor, "..."]:
        """Check the shape, then apply the operator.

        Raises:
            ValueError: If the trailing shape of `x` is not `domain_shape`.
        """
        if tuple(x.shape[x.ndim - len(self.domain_shape) :]) != self.domain_shape:
            name = type(self).__name__
            raise ValueError(f"{name} takes arrays that end in {self.domain_shape}, got {tuple(x.shape)}.")
        return self.forward(x)

    @final
    def __matmul__(self, x: Float[Tensor, "..."]) -> Float[Tensor, "..."]:
        """Return what calling the operator does: `A @ x`, and `A.T @ y`."""
        return self(x)

    @property
    def T(self) -> "LinearOperator":
        """The adjoint as an operator; `A.T.T is A`."""
        return _Adjoint(self)


@final
class _Adjoint(LinearOperator):
    def __init__(self, of: LinearOperator) -> None:
        self.of = of
        self.domain_shape, self.range_shape = of.range_shape, of.domain_shape

    @override
    def __repr__(self) -> str:
        return f"{self.of!r}.T"

    @override
    def forward(self, x: Float[Tensor, "..."]) -> Float[Tensor, "..."]:
        return self.of.adjoint(x)

    @override
    def adjoint(self, y: Float[Tensor, "..."]) -> Float[Tensor, "..."]:
        return self.of.forward(y)

    @property
    @override
    def T(self) -> LinearOperator:
        return self.of
