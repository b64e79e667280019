"""Patients of other sizes."""

from dataclasses import dataclass, replace

from typing_extensions import override

from pnpct.geometry import ImageGrid
from pnpct.simulation.body import Body
from pnpct.simulation.phantom import Phantom


@dataclass(frozen=True, eq=False)
class ResizedBody(Body):
    """A body of another size, along all three axes.

    Args:
        body: The body.
        scale: Its size over that of the body, > 0.
    """

    body: Body
    scale: float

    @property
    @override
    def extent(self) -> tuple[float, float]:
        """The lowest and the highest z at which the object is known, mm."""
        low, high = self.body.extent
        return self.scale * low, self.scale * high

    @override
    def slice(self, z: float, grid: ImageGrid) -> Phantom:
        """Return the slice at a height, on a grid of this size."""
        x, y = grid.center
        smaller = replace(grid, spacing=grid.spacing / self.scale, center=(x / self.scale, y / self.scale))
        low, high = self.body.extent
        of_body = self.body.slice(min(max(z / self.scale, low), high), smaller)  # rounding must not leave the body
        return replace(of_body, grid=grid)
