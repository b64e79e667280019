"""Three-dimensional objects, seen slice by slice."""

from typing import Protocol, runtime_checkable

from pnpct.geometry import ImageGrid
from pnpct.simulation.phantom import Phantom


@runtime_checkable
class Body(Protocol):
    """A three-dimensional object: it says what a slice of it is made of.

    Whole volumes of all materials would take gigabytes; a scanner needs one slice at a time. The same z gives
    the same slice whenever it is asked for. x and y are those of the slice; z grows from the feet to the head.
    """

    @property
    def extent(self) -> tuple[float, float]:
        """The lowest and the highest z at which the object is known, mm."""

    def slice(self, z: float, grid: ImageGrid) -> Phantom:
        """Return the slice at a height.

        Args:
            z: Height, mm, within `extent`.
            grid: Where the pixels of the slice are.

        Raises:
            ValueError: If z is outside the extent.
        """
