"""Bodies that are painted: solids of tissue, one over the other."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import torch
from numpy.typing import NDArray

from pnpct.geometry import ImageGrid
from pnpct.geometry.short_repr import short_repr
from pnpct.simulation.anatomy.shapes import Shape
from pnpct.simulation.anatomy.texture import Texture
from pnpct.simulation.anatomy.tissues import CORTICAL_BONE, SPONGY_BONE, Tissue
from pnpct.simulation.phantom import Phantom

# Numbers of the fields that bend the plane; 0 is that of the tissues.
_ACROSS, _UP = 1, 2


@dataclass(frozen=True)
class Layer:
    """A solid of one tissue.

    Args:
        shape: Where it is.
        tissue: What it is made of.
        opacity: Share of what was there that it replaces, 0 to 1; below 1 for things thinner than a pixel.
    """

    shape: Shape
    tissue: Tissue
    opacity: float = 1.0


def bone(shape: Shape, wall: float, *, marrow: Tissue = SPONGY_BONE) -> Iterator[Layer]:
    """Return a bone: cortical bone with a wall of this thickness, mm, around spongy bone."""
    yield Layer(shape, CORTICAL_BONE)
    yield Layer(shape.grown(-wall), marrow)


@dataclass(frozen=True, eq=False)
class PaintedBody:
    """A body in air, painted layer by layer; later layers cover earlier ones.

    Space is bent by smooth random displacements before anything is drawn, so that no outline is a perfect
    curve. All randomness is laid out in millimetres: one seed gives the same body on every grid.

    Args:
        layers: What is painted, in this order.
        lowest: Lowest height of the body, mm.
        highest: Highest height, mm.
        seed: Of the textures and of the bending, ≥ 0.
        bending: Standard deviation of the displacement along x and along y, mm, for each correlation length
            in mm.
    """

    layers: Sequence[Layer]
    lowest: float
    highest: float
    seed: int
    bending: Mapping[float, float] = field(default_factory=lambda: {40.0: 2.5, 9.0: 0.6})

    __repr__ = short_repr

    @property
    def extent(self) -> tuple[float, float]:
        """The lowest and the highest z, mm."""
        return self.lowest, self.highest

    @property
    def materials(self) -> tuple[str, ...]:
        """All materials that occur; air comes first."""
        found = (material for layer in self.layers for material in layer.tissue.materials)
        return tuple(dict.fromkeys(("air", *found)))

    def slice(self, z: float, grid: ImageGrid) -> Phantom:
        """Paint the slice at a height.

        Args:
            z: Height, mm, within `extent`.
            grid: Where the pixels are.

        Raises:
            ValueError: If z is outside the extent.
        """
        if not self.lowest <= z <= self.highest:
            raise ValueError(f"This body reaches from z = {self.lowest:g} to {self.highest:g} mm, got {z:g}.")
        texture = Texture(self.seed, z, grid)
        x = grid.x.astype(np.float32)[None, :] + texture.sum(self.bending, which=_ACROSS)
        y = grid.y.astype(np.float32)[:, None] + texture.sum(self.bending, which=_UP)
        materials = self.materials
        fractions = np.zeros((len(materials), *grid.shape), dtype=np.float32)
        fractions[0] = 1.0
        margin = 4 * sum(self.bending.values()) + grid.spacing
        for layer in self.layers:
            if layer.shape.low[2] <= z <= layer.shape.high[2]:
                window = _window(layer.shape, grid, margin)
                if x[window].size:
                    _paint(fractions, materials, layer, (x, y, z), window, texture, grid.spacing)
        return Phantom(materials, torch.from_numpy(fractions), grid)


def _window(shape: Shape, grid: ImageGrid, margin: float) -> tuple[slice, slice]:
    cols = np.searchsorted(grid.x, [shape.low[0] - margin, shape.high[0] + margin])
    rows = np.searchsorted(-grid.y, [-shape.high[1] - margin, -shape.low[1] + margin])
    return slice(*rows.tolist()), slice(*cols.tolist())


def _paint(
    fractions: NDArray[np.float32],
    materials: tuple[str, ...],
    layer: Layer,
    where: tuple[NDArray[np.float32], NDArray[np.float32], float],
    window: tuple[slice, slice],
    texture: Texture,
    spacing: float,
) -> None:
    """Replace what is inside; pixels on the outline keep their share of what was."""
    x, y, z = where
    inside = np.clip(0.5 - layer.shape.distance(x[window], y[window], z) / spacing, 0.0, 1.0) * layer.opacity
    if not inside.any():
        return
    covered = fractions[:, *window]
    covered *= 1 - inside
    for material, share in layer.tissue.fractions(texture, y, window).items():
        covered[materials.index(material)] += inside * share
