"""A slice that shapes are painted on, one over the other."""

from collections.abc import Mapping

import numpy as np
import torch
from numpy.typing import NDArray

from pnpct.geometry import ImageGrid
from pnpct.simulation.phantom import Phantom
from pnpct.simulation.shapes import Shape

Mixture = Mapping[str, float | NDArray[np.float64]]
"""Share of each material, one number or one per pixel; they sum to 1."""


class Canvas:
    """Volume fractions under construction: air at first, then whatever is painted over it.

    The plane is bent by a smooth random displacement before anything is drawn, so that no outline is a
    perfect curve. All randomness is laid out in millimetres: the same generator draws the same anatomy on
    every grid.

    Args:
        materials: Names of the materials that will be painted, "air" among them.
        grid: Where the pixels are.
        generator: Source of the bending and of textures.
        bending: Standard deviation of the displacement in mm, for each of its correlation lengths in mm.
    """

    def __init__(
        self,
        materials: tuple[str, ...],
        grid: ImageGrid,
        generator: np.random.Generator,
        *,
        bending: Mapping[float, float],
    ) -> None:
        self.materials, self.grid, self._generator = materials, grid, generator
        self._fractions = np.zeros((len(materials), *grid.shape), dtype=np.float32)
        self._fractions[materials.index("air")] = 1.0
        self.x, self.y = np.broadcast_arrays(grid.x[None, :], grid.y[:, None])
        for length, deviation in bending.items():
            self.x, self.y = self.x + deviation * self.noise(length), self.y + deviation * self.noise(length)
        self._margin = 4 * sum(bending.values()) + grid.spacing

    def noise(self, length: float) -> NDArray[np.float64]:
        """Draw a Gaussian field of mean 0 and variance 1, with a Gaussian kernel of this s.d. in mm."""
        # White noise on a lattice over ±400 mm, blurred onto the pixels: the same field for every grid.
        lattice = np.arange(-400.0, 400.0, length)
        white = self._generator.standard_normal((len(lattice), len(lattice)))
        rows, cols = (np.exp(-0.5 * ((at[:, None] - lattice) / length) ** 2) for at in (self.grid.y, self.grid.x))
        rows, cols = (kernel / np.linalg.norm(kernel, axis=1, keepdims=True) for kernel in (rows, cols))
        field: NDArray[np.float64] = rows @ white @ cols.T
        return field

    def paint(self, shape: Shape, mixture: Mixture, *, opacity: float = 1.0) -> None:
        """Replace what is inside a shape by a mixture; pixels on the outline keep their share of what was.

        An opacity below 1 leaves some of it everywhere: the thing is thinner than the slice.
        """
        window = self._window(shape)
        x, y = self.x[window], self.y[window]
        if x.size == 0:
            return
        inside = opacity * np.clip(0.5 - shape.distance(x, y) / self.grid.spacing, 0.0, 1.0)
        layers = self._fractions[:, *window]
        layers *= 1 - inside
        for material, share in mixture.items():
            local = share if isinstance(share, float) else share[window]
            layers[self.materials.index(material)] += inside * local

    def finish(self) -> Phantom:
        """Return the phantom."""
        return Phantom(self.materials, torch.from_numpy(self._fractions), self.grid)

    def _window(self, shape: Shape) -> tuple[slice, slice]:
        reach = shape.reach + self._margin
        cols = np.searchsorted(self.grid.x, [shape.center[0] - reach, shape.center[0] + reach])
        rows = np.searchsorted(-self.grid.y, [-shape.center[1] - reach, -shape.center[1] + reach])
        return slice(*rows.tolist()), slice(*cols.tolist())
