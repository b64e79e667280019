"""Stomach, small bowel and colon: how they are laid, and what is in them."""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pnpct.simulation.anatomy.painted_body import Layer
from pnpct.simulation.anatomy.room import Room, as_point
from pnpct.simulation.anatomy.shapes import Point, Shape, capsule
from pnpct.simulation.anatomy.tissues import AIR, Tissue
from pnpct.simulation.anatomy.variation import Variation

STOOL = Tissue(
    {"muscle": 0.62, "adipose": 0.30, "cortical bone": 0.01, "water": 0.07},
    {"air": 0.9, "adipose": 0.1},
    share=-0.28,
    texture={0.9: 0.07, 2.5: 0.36},
)
"""Dense, with bubbles of gas."""


def juice(iodine: float = 0.0) -> Tissue:
    """Return what is liquid in stomach and bowel, with contrast medium that was drunk, if any."""
    return Tissue(
        {"water": 0.7 * (1 - iodine), "muscle": 0.3 * (1 - iodine), "iodinated blood": iodine},
        {"muscle": 0.8 * (1 - iodine), "adipose": 0.2 * (1 - iodine), "iodinated blood": iodine},
        share=0.3,
        texture={0.9: 0.12, 2.5: 0.25},
    )


def folded(wall: Tissue) -> Tissue:
    """Return what an empty bowel shows: folds of its wall with some liquid between them."""
    return Tissue(wall.base, {"water": 0.8, "muscle": 0.2}, share=0.3, texture={0.9: 0.14, 2.5: 0.3})


@dataclass(frozen=True)
class Bowel:
    """A piece of bowel along a line.

    Args:
        points: Its middle, one point about every 4 to 8 mm.
        radii: Outer radius at each point, mm.
        wall: Tissue of the wall.
        thickness: Of the wall, mm.
        content: What fills it, but for the gas.
        gas: Depth of the gas that floats on top, mm; 0 for none.
    """

    points: Sequence[Point]
    radii: Sequence[float]
    wall: Tissue
    thickness: float
    content: Tissue
    gas: float = 0.0

    def walls(self) -> Iterator[Layer]:
        """Return all that the wall encloses, as wall."""
        yield from (Layer(piece, self.wall) for piece in self._pieces(0.0))

    def contents(self) -> Iterator[Layer]:
        """Return what is inside the wall; to be painted when all walls have been."""
        inside = list(self._pieces(self.thickness))
        yield from (Layer(piece, self.content) for piece in inside)
        if self.gas > 0:
            top = max(y + r for (_, y, _), r in zip(self.points, self.radii, strict=True))
            above = _above(top - self.thickness - self.gas)
            yield from (Layer(piece.within(above), AIR) for piece in inside if piece.high[1] > above.low[1])

    def _pieces(self, inset: float) -> Iterator[Shape]:
        radii = [max(radius - inset, 0.8) for radius in self.radii]
        for start, end, first, last in zip(self.points[:-1], self.points[1:], radii[:-1], radii[1:], strict=True):
            yield capsule(start, end, first, last)


def _above(level: float) -> Shape:
    """All in front of a level: a supine patient's gas rises to the front."""
    return Shape(lambda x, y, _: level - y + 0 * x, (-1e3, level, -1e3), (1e3, 1e3, 1e3))


def smooth_line(corners: Sequence[Point], step: float) -> list[Point]:
    """Return points at about every `step` mm of a smooth line through corners (Catmull-Rom)."""
    padded = np.array([corners[0], *corners, corners[-1]], dtype=float)
    points = []
    for before, start, end, after in zip(padded, padded[1:], padded[2:], padded[3:], strict=False):
        count = max(round(float(np.linalg.norm(end - start)) / step), 1)
        for t in (np.arange(count) / count)[:, None]:
            slopes = (end - before) / 2, (after - start) / 2
            ends = (2 * t**3 - 3 * t**2 + 1) * start + (3 * t**2 - 2 * t**3) * end
            points.append(ends + (t**3 - 2 * t**2 + t) * slopes[0] + (t**3 - t**2) * slopes[1])
    return [as_point(point) for point in (*points, padded[-1])]


def haustra(points: Sequence[Point], radius: float, vary: Variation, *, depth: float = 0.24) -> list[float]:
    """Return radii along a colon: sacs of 20 to 40 mm between folds, `depth` of the radius deep."""
    radii, phase = [], 0.0
    for start, end in zip((points[0], *points), points, strict=False):
        phase += math.dist(start, end) * math.pi / vary(29.0, 5.0)
        fold = abs(math.cos(phase)) ** 5
        radii.append(radius * vary(1.0, 0.03) * (1.04 - depth * fold))
    return radii


def pieces(points: Sequence[Point], radii: Sequence[float], length: int) -> Iterator[slice]:
    """Yield the index ranges of pieces of about so many points; neighbours share a point."""
    count = max(round(len(points) / length), 1)
    cuts = np.linspace(0, len(radii) - 1, count + 1).round().astype(int).tolist()
    yield from (slice(first, last + 1) for first, last in itertools.pairwise(cuts))


def colon(points: Sequence[Point], radii: Sequence[float], wall: Tissue, vary: Variation) -> Iterator[Bowel]:
    """Fill a piece of colon with stool and gas, wider here and narrower there."""
    for part in pieces(points, radii, 17):
        size, gas = vary.between(0.77, 1.17), vary.between(-18, 22)
        content = STOOL if vary.between(0, 1) < 0.9 else folded(wall)
        yield Bowel(points[part], [size * r for r in radii[part]], wall, vary(2.3, 0.4), content, max(gas, 0.0))


def small_bowel(
    room: Room, others: Sequence[Bowel], wall: Tissue, vary: Variation, *, filled: float, oral: float = 0.0
) -> Iterator[Bowel]:
    """Lay loops of small bowel into a room, most of them empty or with some gas.

    Args:
        room: Where they may go.
        others: Bowel that is there already.
        wall: Tissue of the wall.
        vary: Generator of the variation.
        filled: Share of the length that is filled with liquid, 0 to 1.
        oral: Iodine in the liquid: share of blood with 10 mg/ml of it, 0 to 1.
    """
    taken = [ball for tract in others for ball in list(zip(tract.points, tract.radii, strict=True))[::3]]
    calibre = vary(10.5, 1.0)
    for line in wander(room, calibre, vary, taken, gap=vary(1.2, 0.5)):
        points = smooth_line(line, 5.0)
        radii = [calibre * vary(1.0, 0.05) for _ in points]
        for part in pieces(points, radii, 12):
            size, gas = vary.between(0.78, 1.12), max(vary(-4, 7), 0.0)
            content = juice(oral * vary.between(0.6, 1.0)) if vary.between(0, 1) < filled else folded(wall)
            yield Bowel(points[part], [size * r for r in radii[part]], wall, vary(3.0, 0.7), content, gas)


def painted(tracts: Sequence[Bowel]) -> Iterator[Layer]:
    """Return the layers of pieces that touch: all walls, then what is in them."""
    yield from (layer for tract in tracts for layer in tract.walls())
    yield from (layer for tract in tracts for layer in tract.contents())


def wander(
    room: Room,
    radius: float,
    vary: Variation,
    taken: Sequence[tuple[Point, float]] = (),
    *,
    step: float = 6.0,
    gap: float = 2.0,
    loops: int = 120,
) -> Iterator[list[Point]]:
    """Lay bowel into a room, loop beside loop, until there is no place left.

    Args:
        room: Where it may go.
        radius: Outer radius of the bowel, mm.
        vary: Generator of the variation.
        taken: Middles and radii of balls where it may not go, mm.
        step: Distance between points, mm.
        gap: Fat between loops, mm.
        loops: How often to look for a new start at most where a loop has no way on.

    Yields:
        Lines of at least four points.
    """
    laid = np.array([point for point, _ in taken]).reshape(-1, 3)
    wide = np.array([thick for _, thick in taken])
    for _ in range(loops):
        starts = np.array([room.draw(vary.generator, radius) for _ in range(4)])
        free = np.minimum(_clearance(starts, laid, wide), room.depth(starts)) - radius - gap
        if free.max() < 0:
            continue
        line = [starts[int(np.argmin(np.where(free < 0, np.inf, free)))]]
        way = vary.generator.standard_normal(3)
        while len(line) < 70:
            trials = way / np.linalg.norm(way) + 0.6 * vary.generator.standard_normal((24, 3))
            trials /= np.linalg.norm(trials, axis=1, keepdims=True)
            ends = line[-1] + step * trials
            own = np.array(line[: -math.ceil(2.4 * radius / step)]).reshape(-1, 3)
            clear = np.minimum(_clearance(ends, laid, wide), _clearance(ends, own, np.full(len(own), radius)))
            left = np.minimum(clear - gap, room.depth(ends)) - radius
            # Close to what is there already, so that loops pack.
            wish = np.where(left < 0, -np.inf, -0.15 * np.minimum(left, 15.0) + 1.5 * trials @ way)
            best = int(np.argmax(wish))
            if wish[best] == -np.inf:
                break
            way = trials[best]
            line.append(ends[best])
        if len(line) > 3:
            laid, wide = np.concatenate((laid, line)), np.concatenate((wide, np.full(len(line), radius)))
            yield [as_point(point) for point in line]


def _clearance(
    points: NDArray[np.float64], others: NDArray[np.float64], radii: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Distance of each point to the nearest of the balls around others."""
    if len(others) == 0:
        return np.full(len(points), 1e3)
    apart = points[:, None] - others[None]
    nearest: NDArray[np.float64] = (np.sqrt(np.einsum("pqc,pqc->pq", apart, apart)) - radii).min(axis=1)
    return nearest
