"""The repr of a frozen value in a line or a few: arrays by shape and range, long sequences by their ends."""

import reprlib
from dataclasses import fields
from numbers import Number
from typing import Any


class _Short(reprlib.Repr):
    """Asks arrays and networks for what they have in common, so that none of their libraries is imported."""

    def __init__(self) -> None:
        super().__init__()
        self.maxlevel, self.maxdict, self.maxstring, self.maxother = 3, 16, 60, 400

    def repr_instance(self, x: Any, level: int) -> str:  # what reprlib calls for all but built-in types
        if hasattr(x, "dtype") and hasattr(x, "shape"):
            return _array(x)
        if callable(parameters := getattr(x, "parameters", None)):
            return f"{type(x).__name__} of {sum(each.numel() for each in parameters())} weights"
        return getattr(x, "__qualname__", None) or super().repr_instance(x, level)

    def repr_float(self, x: float, level: int) -> str:  # noqa: ARG002
        return f"{x:.6g}"

    def repr_tuple(self, x: Any, level: int) -> str:
        if len(x) <= self.maxtuple or isinstance(x[0], Number | str):
            return super().repr_tuple(x, level)
        return f"{len(x)} {type(x[0]).__name__}"

    repr_list = repr_tuple


def _array(x: Any) -> str:
    name = f"{str(x.dtype).removeprefix('torch.')}[{', '.join(map(str, x.shape))}]"
    numbers = 0 not in x.shape and name.startswith(("float", "int", "uint"))
    return f"{name} from {float(x.min()):.4g} to {float(x.max()):.4g}" if numbers else name


_SHORT = _Short()


def short_repr(value: Any) -> str:
    """Return the repr of a dataclass in which an array is its type, shape and range: `__repr__ = short_repr`.

    Example:
        >>> from dataclasses import dataclass
        >>> import numpy as np
        >>> @dataclass
        ... class Measured:
        ...     counts: np.ndarray
        ...     angles: tuple[float, ...]
        ...     __repr__ = short_repr
        >>> Measured(np.linspace(0, 5, 600).reshape(3, 200), tuple(0.01 * view for view in range(984)))
        Measured(counts=float64[3, 200] from 0 to 5, angles=(0, 0.01, 0.02, 0.03, 0.04, 0.05, ...))
    """
    shown = (f"{field.name}={_SHORT.repr(getattr(value, field.name))}" for field in fields(value) if field.repr)
    return f"{type(value).__name__}({', '.join(shown)})"
