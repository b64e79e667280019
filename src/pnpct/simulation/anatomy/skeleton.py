"""Bones that several parts of the body have: vertebrae and ribs."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pnpct.simulation.anatomy.painted_body import Layer, bone
from pnpct.simulation.anatomy.shapes import Array, Shape, capsule, ellipsoid, union
from pnpct.simulation.anatomy.tissues import CARTILAGE, FAT, Tissue

CORD = Tissue({"water": 0.5, "muscle": 0.5})
DISC = Tissue({"muscle": 1.0}, {"cortical bone": 1.0}, share=0.02, texture={2.5: 0.006})


def vertebra(center: tuple[float, float, float], width: float, depth: float, height: float) -> Iterator[Layer]:
    """Return a vertebra without the canal, which `spinal_canal` paints through all of them.

    Args:
        center: Middle of its body, mm.
        width: Half axis of the body from side to side, mm.
        depth: Half axis from front to back, mm.
        height: Half the distance to the next vertebra, disc included, mm.
    """
    x, y, z = center
    yield Layer(ellipsoid((x, y, z), (width, depth, 1.15 * height), power=5.0), DISC)
    body = ellipsoid((x, y, z), (width, depth, 0.88 * height), power=4.0)
    arch = [capsule((x + s * 13, y - 13, z + 3), (x + s * 14, y - 26, z), 5.0) for s in (-1, 1)]
    arch += [capsule((x + s * 14, y - 26, z), (x, y - 37, z - 4), 4.0) for s in (-1, 1)]
    arch += [capsule((x + s * 15, y - 24, z), (x + s * (width + 16), y - 33, z + 2), 5.0, 4.0) for s in (-1, 1)]
    arch += [capsule((x + s * 15, y - 25, z + height), (x + s * 15, y - 27, z - height), 5.0) for s in (-1, 1)]
    spinous = capsule((x, y - 36, z - 3), (x, y - depth - 32, z - 0.7 * height), 3.8, 3.2)
    yield from bone(union(body, *arch, spinous, smoothing=2.0), 1.4)


def spinal_canal(x: float, y: float, lowest: float, highest: float) -> Iterator[Layer]:
    """Return the canal behind vertebral bodies centred at x and y: fat, and the cord in it."""
    middle = (x, y - 25)
    for half_axes, tissue in (((9.5, 8.0), FAT), ((7.0, 5.8), CORD)):
        whole = ellipsoid((*middle, (lowest + highest) / 2), (*half_axes, 1e4))
        yield Layer(whole.between(lowest, highest), tissue)


@dataclass(frozen=True)
class Rib:
    """A rib along the surface of a rib cage, from the spine down to the front, and its cartilage.

    Args:
        cage: Solid whose surface it follows.
        side: 1 for the patient's left, at growing x, or −1.
        height: z at the spine, mm.
        drop: How much lower its lowest point is, mm.
        first, last: Where the bone begins and ends: angle around the middle of the cage, 0 at the side and
            growing towards the front, rad.
    """

    cage: Shape
    side: int
    height: float
    drop: float
    first: float = -1.25
    last: float = 0.8

    def layers(self) -> Iterator[Layer]:
        """Return the bone and the cartilage."""
        yield Layer(self._piece(self.last - 0.02, self.last + 0.55, (4.0, 6.0), rise=55.0), CARTILAGE)
        yield from bone(self._piece(self.first, self.last, (3.3, 6.0), rise=0.0), 1.0)

    def _piece(self, first: float, last: float, half_axes: tuple[float, float], *, rise: float) -> Shape:
        cage, side, radius = self.cage, self.side, 120.0
        thick, high = half_axes

        def distance(x: Array, y: Array, z: float) -> Array:
            angle = np.arctan2(y + 12, side * x)
            share = (angle - self.first) / (self.last - self.first)
            middle = self.height - self.drop * np.clip(share, 0.0, 1.0) ** 1.2
            middle = middle + rise * np.maximum(angle - self.last, 0.0)
            beyond = radius * np.maximum(np.maximum(first - angle, angle - last), 0.0)
            across = (cage.distance(x, y, z) - 3.5) / thick
            return thick * (np.sqrt(across**2 + ((z - middle) / high) ** 2 + (beyond / thick) ** 2) - 1)

        (x0, y0, _), (x1, y1, _) = cage.low, cage.high
        low = self.height - self.drop - high
        top = (self.height if first == self.first else low + 2 * high + rise * (last - self.last)) + high
        inner = min(math.cos(first), math.cos(last)) * 60.0
        across = sorted((side * inner, side * (max(-x0, x1) + 12)))
        return Shape(distance, (across[0] - 12, y0 - 12, low), (across[1] + 12, y1 + 12, top))
