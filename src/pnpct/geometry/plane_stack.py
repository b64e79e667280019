"""Planes that are nearly horizontal, one above the other."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True)
class Plane:
    """A plane that is nearly horizontal.

    Args:
        z: Height on the axis, mm.
        slope: Growth of the height along x and along y.

    Example:
        >>> Plane(10.0, slope=(0.01, 0.0)).heights(np.array([-100.0, 0.0]), np.zeros(2)).tolist()
        [9.0, 10.0]
    """

    z: float
    slope: tuple[float, float] = (0.0, 0.0)

    def heights(self, x: Array, y: Array) -> Array:
        """Return the height at each point, mm."""
        return self.z + self.slope[0] * x + self.slope[1] * y


@dataclass(frozen=True)
class PlaneStack:
    """Neighbouring planes that take the same views.

    Args:
        center: Middle of their window, in steps of 2π/2¹⁹.
        planes: From the lowest up.
    """

    center: int
    planes: tuple[Plane, ...]


def spanning(stacks: Sequence[PlaneStack], low: float, high: float) -> list[PlaneStack]:
    """Return the fewest stacks with a plane at or below `low` and one at or above `high`, as far as there are any."""
    begin = max((number for number, stack in enumerate(stacks) if stack.planes[0].z <= low), default=0)
    end = min((number for number, stack in enumerate(stacks) if stack.planes[-1].z >= high), default=len(stacks) - 1)
    return list(stacks[begin : end + 1])
