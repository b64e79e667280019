"""Room inside organs, and what grows in it: branching vessels, and fat between the fibres of a muscle."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pnpct.simulation.anatomy.painted_body import Layer
from pnpct.simulation.anatomy.sections import sheet
from pnpct.simulation.anatomy.shapes import Point, Shape, capsule
from pnpct.simulation.anatomy.tissues import FAT
from pnpct.simulation.anatomy.variation import Variation


@dataclass(frozen=True, eq=False)
class Room:
    """How deep inside a solid places are, on a lattice, for whatever has to find its way in it.

    Args:
        shape: The solid; what is outside its box is not in it.
        spacing: Of the lattice, mm.
    """

    shape: Shape
    spacing: float = 4.0
    _depths: NDArray[np.float32] = field(init=False, repr=False)
    _last: NDArray[np.int64] = field(init=False, repr=False)
    _strides: NDArray[np.int64] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        xs, ys, zs = (
            np.arange(low, high + self.spacing, self.spacing)
            for low, high in zip(self.shape.low, self.shape.high, strict=True)
        )
        planes = [-self.shape.distance(xs[:, None], ys[None, :], z) for z in zs.tolist()]
        # A rim of far outside around the lattice stands for all places beyond it.
        depths = np.pad(np.stack(planes, axis=-1).astype(np.float32), 1, constant_values=-1e3)
        object.__setattr__(self, "_depths", depths)
        object.__setattr__(self, "_last", np.array(depths.shape) - 1)
        object.__setattr__(self, "_strides", np.array(depths.strides) // depths.itemsize)

    def depth(self, points: NDArray[np.float64]) -> NDArray[np.float32]:
        """Return how far inside the surface points are, mm; negative outside."""
        place = np.rint((points - self.shape.low) / self.spacing).astype(np.int64) + 1
        found: NDArray[np.float32] = self._depths.take(np.minimum(np.maximum(place, 0), self._last) @ self._strides)
        return found

    def draw(self, generator: np.random.Generator, depth: float) -> Point:
        """Draw a place at least so deep inside; the deepest of 120 if there is none."""
        points = generator.uniform(self.shape.low, self.shape.high, (120, 3))
        depths = self.depth(points)
        return as_point(points[int(np.argmax(np.minimum(depths, depth)))])


def tree(
    start: Point,
    heading: Point,
    radius: float,
    room: Room,
    vary: Variation,
    *,
    thinnest: float = 0.6,
    spread: float = 0.5,
) -> Iterator[tuple[Shape, float]]:
    """Grow a vessel and its branches as far as there is room.

    Args:
        start: Its root, mm.
        heading: Direction in which it starts.
        radius: At the root, mm.
        room: Where it may go.
        vary: Generator of the variation.
        thinnest: Radius at which branches end, mm.
        spread: How far branches turn away, rad, about.

    Yields:
        Pieces, each with its radius in mm.
    """
    ahead = [(np.array(start), np.array(heading) / math.hypot(*heading), radius)]
    while ahead:
        here, way, thick = ahead.pop()
        trials = way + 0.25 * vary.generator.standard_normal((6, 3))
        trials /= np.linalg.norm(trials, axis=1, keepdims=True)
        ends = here + trials * (4.0 + 3.0 * thick)
        depths = room.depth(ends)
        best = int(np.argmax(np.minimum(depths, 8.0) + 6 * trials @ way))
        if depths[best] < 1.0:
            continue
        yield capsule(as_point(here), as_point(ends[best]), thick, 0.93 * thick), thick
        way = trials[best]
        aside = way + spread * vary.generator.standard_normal(3)
        for turned, share in ((way, vary(0.88, 0.04)), (aside / np.linalg.norm(aside), vary(0.66, 0.08))):
            if share * thick > thinnest:
                ahead.append((ends[best], turned, share * thick))


def streaks(shape: Shape, count: int, vary: Variation) -> Iterator[Layer]:
    """Return septa of fat inside a muscle that runs up and down, in random places and of random length."""
    room = Room(shape)
    for _ in range(count):
        x, y, z = room.draw(vary.generator, 4.0)
        turn, high, thick = vary.between(0, 2 * math.pi), vary(22.0, 6.0), vary(0.55, 0.2)
        bends = [vary(0.0, 0.45) for _ in range(4)]
        stations = []
        for end in (-1, 1):
            line, (px, py), way = [(x, y, 0.3)], (x + vary(0.0, 1.5), y + vary(0.0, 1.5)), turn + end * vary(0.15, 0.1)
            for bend in bends:
                way += bend
                px, py = px + vary(3.2, 0.8) * math.cos(way), py + vary(3.2, 0.8) * math.sin(way)
                line.append((px, py, thick))
            stations.append((z + end * high, [*line[:-1], (px, py, 0.3)]))
        septum = sheet(*stations, smoothing=0.0)
        ends = np.array([[px, py, z] for _, line in stations for px, py, _ in line[-2:]])
        if room.depth(ends).min() > 1.0:
            yield Layer(septum, FAT, opacity=vary(0.7, 0.12))


def as_point(values: NDArray[np.float64]) -> Point:
    """Return three numbers as a point."""
    x, y, z = values.tolist()
    return (x, y, z)
