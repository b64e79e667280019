"""The two hemispheres of the brain: a folded cortex around white matter."""

from collections.abc import Iterator

import numpy as np

from pnpct.simulation.anatomy.folds import random_folds
from pnpct.simulation.anatomy.painted_body import Layer
from pnpct.simulation.anatomy.shapes import Array, Shape, ellipsoid
from pnpct.simulation.anatomy.tissues import Tissue
from pnpct.simulation.anatomy.variation import Variation

GREY = Tissue(
    {"brain grey matter": 1.0}, {"brain white matter": 1.0}, share=0.1, texture={0.9: 0.06, 2.5: 0.08, 9.0: 0.04}
)
WHITE = Tissue(
    {"brain white matter": 1.0}, {"brain grey matter": 1.0}, share=0.12, texture={0.9: 0.06, 2.5: 0.08, 9.0: 0.06}
)
# The hemispheres are one where the callosum and the thalami join them.
_JOINED = ellipsoid((0, 2, 74), (25, 37, 22))


class Cerebrum:
    """The hemispheres of one patient.

    Args:
        vary: Generator of the variation.
        cavity: Inside of the skull.
        room: The part of the skull's inside that is theirs.
        width: Half the width of a sulcus at the surface, mm, ≥ 0.
    """

    def __init__(self, vary: Variation, cavity: Shape, room: Shape, width: float) -> None:
        self.cavity, self.room, self.width = cavity, room, width
        self.cortex = vary(2.5, 0.12)
        self.gap = 0.6 + 0.8 * width
        self.sulci = random_folds(vary.generator, vary(15.5, 0.7), count=12)
        self.branches = random_folds(vary.generator, 42.0, count=8)
        self.front_of_insula = [vary(24, 2) for _ in range(2)]

    def layers(self) -> Iterator[Layer]:
        """Return cortex and white matter; what is between the gyri stays as it was."""
        yield Layer(self._deeper(0.0), GREY)
        yield Layer(self._deeper(self.cortex), WHITE)

    def _deeper(self, depth: float) -> Shape:
        return Shape(lambda x, y, z: depth - self.depth(x, y, z), self.room.low, self.room.high)

    def depth(self, x: Array, y: Array, z: float) -> Array:
        """Return how far below the surface of the nearest gyrus places are, mm; negative in sulci."""
        out, joined = np.abs(x), -_JOINED.distance(x, y, z)
        below = -self.room.distance(x, y, z) - self.gap
        fissure = out - 0.7 - self.width
        surface = np.minimum(below, np.maximum(fissure, joined))
        # Sulci come from the side of the skull and from the midline, not from the cisterns.
        outer = np.minimum(-self.cavity.distance(x, y, z), np.maximum(2 * fissure, 3 * joined + 15))
        sulci = self._to_sulci(x, y, z, outer - self.gap)
        nearest: Array = np.minimum(np.minimum(surface, sulci), self._to_sylvian_fissure(x, y, z))
        return nearest

    def _to_sulci(self, x: Array, y: Array, z: float, surface: Array) -> Array:
        # Folds of a sphere around the middle of the hemisphere: sulci lead straight inwards.
        middle = np.where(x > 0, np.float32(22), np.float32(-22))
        a, b, c = (x - middle) / 42, (y + 4) / 76, (z - 74) / 56
        stretch = np.maximum(np.sqrt(a * a + b * b + c * c), 0.25) ** -0.75
        sideways = self.sulci.distance(middle + 42 * a * stretch, -4 + 76 * b * stretch, 74 + 56 * c * stretch)
        place = self.branches.distance(x, y, z) / 10.5  # 0 to 1
        reach = 8.0 + 15.0 * place
        width = self.width * (1.3 - 0.7 * place) * np.sqrt(np.clip(1 - surface / reach, 0.0, 1.0))
        distance: Array = np.hypot(np.maximum(sideways / stretch - width, 0), np.maximum(surface - reach, 0)) - 1e-3
        return distance

    def _to_sylvian_fissure(self, x: Array, y: Array, z: float) -> Array:
        """Distance to the cleft above the temporal lobe and to the one over the insula."""
        out = np.abs(x)
        front = np.where(x > 0, np.float32(self.front_of_insula[1]), np.float32(self.front_of_insula[0]))
        island = np.hypot((y - 4) / 21, (z - 70) / 15)
        bowed = 40.5 - 4.5 * np.clip(island, 0, 1.5) ** 2 + 0.8 * np.sin(y / 2.3 + z / 4)
        insula = np.maximum(np.abs(out - bowed) - 0.3 - 0.9 * self.width, 12 * (island - 1))
        level = 62 - 0.42 * (y - front) + 2.5 * np.sin(out / 5 + front) + 0.02 * (out - 42) ** 2
        cleft = np.abs(z - level) * 0.85 - (0.2 + 0.7 * self.width) * (1 - 0.02 * (out - 40))
        distance: Array = np.minimum(insula, np.maximum(cleft, np.maximum(38 - out, -20 - y)))
        return distance
