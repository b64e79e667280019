"""The face: jaws, nose and sinuses, and the orbits with the eyes."""

import math
from collections.abc import Iterator

import numpy as np

from pnpct.simulation.anatomy.folds import random_folds
from pnpct.simulation.anatomy.painted_body import Layer, bone
from pnpct.simulation.anatomy.sections import outline
from pnpct.simulation.anatomy.shapes import Array, Point, Shape, capsule, ellipsoid, loft, tube, union
from pnpct.simulation.anatomy.skull_base import FLUID, MUCOSA, SIDES, SOFT
from pnpct.simulation.anatomy.tissues import AIR, CARTILAGE, CORTICAL_BONE, FAT, Tissue
from pnpct.simulation.anatomy.variation import Variation

_SCLERA = Tissue({"muscle": 0.97, "cortical bone": 0.03})
_VITREOUS = Tissue({"cerebrospinal fluid": 0.9, "muscle": 0.1})
_LENS = Tissue({"muscle": 0.98, "cortical bone": 0.02})
_NERVE = Tissue({"brain white matter": 0.9, "cerebrospinal fluid": 0.1})
# Corners of the left maxillary sinus.
_SINUS = ((16, 70), (27, 75), (38, 70), (46, 58), (34, 44), (21, 37), (16, 46), (15, 58))


class Face:
    """What is in front of the brain and below it, of one patient.

    Args:
        vary: Generator of the variation.
        cavity: Inside of the skull, where nothing of all this may be.
    """

    def __init__(self, vary: Variation, cavity: Shape) -> None:
        self.vary, self.cavity = vary, cavity
        self.cells = random_folds(vary.generator, vary(11.0, 0.7))
        self.orbits = [_orbit(s, vary).without(cavity.grown(1.3)) for s in SIDES]
        self.maxillary = [_maxillary(s, vary(1.0, 0.07)) for s in SIDES]

    def layers(self) -> Iterator[Layer]:
        """Return all of it, from soft tissue to the air."""
        for s in SIDES:
            yield from self.chewing(s)
        for s, orbit, sinus in zip(SIDES, self.orbits, self.maxillary, strict=True):
            yield from self.bones(s, orbit, sinus)
        yield from bone(ellipsoid((0, 77, 54), (22, 9, 14), power=2.5), 1.8)
        yield from self.nose()
        yield from self.sinuses()
        for s, orbit in zip(SIDES, self.orbits, strict=True):
            yield from self.eye(s, orbit)

    def chewing(self, s: int) -> Iterator[Layer]:
        """Return the muscles that move the lower jaw."""
        size = self.vary(1.0, 0.06)
        yield Layer(capsule((s * 62, 36, 14), (s * 56, 24, -14), 8 * size), SOFT)
        yield Layer(ellipsoid((s * 36, 20, 4), (8 * size, 17, 16), angle=-s * 0.5), SOFT)
        yield Layer(ellipsoid((s * 22, 18, 0), (5 * size, 12, 14), angle=-s * 0.3), SOFT)
        yield Layer(ellipsoid((s * 57, 30, 10), (6 * size, 14, 30)), SOFT)

    def bones(self, s: int, orbit: Shape, sinus: Shape) -> Iterator[Layer]:
        """Return the bones of one side: jaws, cheek, nose, and the walls of orbit and sinus."""
        for end in ((15, 17, -4), (22, 18, -4)):  # the plates of the pterygoid
            yield Layer(capsule((s * 14, 26, 22), (s * end[0], *end[1:]), 1.5), CORTICAL_BONE)
        yield from bone(ellipsoid((s * 50, 3, 19), (9, 5, 6), angle=-s * 0.2), 1.2)
        yield from bone(tube([(s * 50, 3, 17), (s * 51, 5, 4), (s * 49, 10, -14)], (4.5, 3.5, 4.5)), 1.3)
        yield from bone(tube([(s * 50, 30, 14), (s * 49, 26, 0), (s * 49, 18, -14)], (2.4, 3.6, 5.0)), 1.2)
        arch: list[Point] = [(s * 50, 56, 16), (s * 64, 40, 17), (s * 68, 22, 19), (s * 63, 6, 23)]
        yield from bone(tube(arch, (5.0, 3.2, 2.8, 3.5)), 1.2)
        yield from bone(ellipsoid((s * 46, 60, 15), (8, 10, 9)), 1.3)
        yield from bone(capsule((s * 50, 60, 18), (s * 51, 58, 56), 4.5, 4.0), 1.3)
        yield from bone(tube([(s * 51, 57, 38), (s * 40, 40, 39), (s * 27, 30, 40)], (3.5, 2.4, 4.0)), 1.2)
        yield Layer(orbit.grown(1.7).without(_in_front_of(68.0)), CORTICAL_BONE)
        turns = np.linspace(0, 2 * math.pi, 11).tolist()
        rim = [(s * (32 + 19.5 * math.cos(t)), 68 - 5 * max(0, math.cos(t)), 38 + 18 * math.sin(t)) for t in turns]
        yield from bone(tube(rim, 2.8, smoothing=1.0), 1.1)
        yield Layer(sinus.grown(1.6), CORTICAL_BONE)
        yield Layer(capsule((s * 4.5, 84, 44), (s * 6, 91, 26), 1.5, 1.1), CORTICAL_BONE)
        yield Layer(capsule((s * 7, 82, 42), (s * 14, 80, 10), 2.2), CORTICAL_BONE)

    def nose(self) -> Iterator[Layer]:
        """The air of nose and throat, the septum and the turbinates."""
        vary = self.vary
        bent = vary(0.0, 2.2)
        cavity = loft([(-12, 0, 58, 16, 30), (12, 0, 58, 16, 30), (28, 0, 56, 9, 27), (44, 0, 60, 4, 22)], power=2.6)
        yield Layer(cavity.grown(1.3), CORTICAL_BONE, opacity=0.75)
        yield Layer(cavity.grown(0.8), MUCOSA)
        throat = loft([(-12, 0, 20, 13, 9), (10, 0, 20, 12, 9), (20, 0, 22, 9, 6)], power=2.4)
        nostrils = [tube([(s * 6, 78, 4), (s * 6.5, 92, 1), (s * 7, 97, -8)], (5.0, 4.5, 4.0)) for s in SIDES]
        for space in (cavity.grown(-0.8), throat, *nostrils):
            yield Layer(space, AIR)
        for s in SIDES:
            swollen = vary(1.0, 0.25)
            yield Layer(ellipsoid((s * 9.5, 58, 2), (4.2 * swollen, 24, 11)), MUCOSA)
            yield Layer(ellipsoid((s * 8.5, 58, 3), (0.8, 20, 8)), CORTICAL_BONE, opacity=0.6)
            yield Layer(ellipsoid((s * 5.5, 54, 19), (2.6 * swollen, 19, 9)), MUCOSA)
            yield Layer(ellipsoid((s * 5.0, 54, 20), (0.7, 15, 5)), CORTICAL_BONE, opacity=0.6)

        def septum(x: Array, y: Array, z: float) -> Array:
            return np.abs(x - bent * np.sin((y - 30) / 18) * math.cos(z / 25)) - 1.4

        wall = Shape(septum, (-6, 26, -12), (6, 98, 44)).within(ellipsoid((0, 58, 14), (30, 38, 34)))
        yield Layer(wall, MUCOSA)
        core = wall.grown(-0.9)
        yield Layer(core.within(ellipsoid((0, 50, 14), (30, 26, 40))), CORTICAL_BONE, opacity=0.6)
        yield Layer(core.within(ellipsoid((0, 84, 8), (30, 12, 20))), CARTILAGE)

    def sinuses(self) -> Iterator[Layer]:
        """Maxillary, sphenoid, frontal and ethmoid sinuses; in some there is fluid."""
        vary = self.vary
        for s, sinus in zip(SIDES, self.maxillary, strict=True):
            yield Layer(sinus, MUCOSA)
            level = vary.between(10, 48)  # fluid lies behind it; the sinus begins at 37
            yield Layer(sinus.grown(-0.6).within(_in_front_of(level)), AIR)
            half_axes = (vary(8.5, 1.0), vary(12.0, 1.5), vary(8.0, 1.0))
            yield Layer(ellipsoid((s * vary(8.0, 0.8), 20, 32), half_axes, power=2.5), AIR)
            size = vary.between(0.3, 1.2)
            frontal = ellipsoid((s * 10 * size, 81, 54), (9 * size, 4.2, 5 + 7 * size), angle=-s * 0.3)
            yield Layer(frontal.without(self.cavity.grown(1.4)), AIR)
        ethmoid = loft([(20, 0, 54, 11, 22), (32, 0, 56, 12.5, 24), (49, 0, 58, 11, 20)], power=3.0)

        def cells(x: Array, y: Array, z: float) -> Array:
            walls = np.minimum(self.cells.distance(x, y, z), np.maximum(np.abs(x) - 0.3, 0))
            return np.maximum(ethmoid.distance(x, y, z), 0.55 - walls)

        yield Layer(ethmoid.grown(0.8).between(20.0, 49.8), CORTICAL_BONE)  # open to the nose below
        yield Layer(ethmoid, MUCOSA)
        yield Layer(Shape(cells, ethmoid.low, ethmoid.high), AIR)

    def eye(self, s: int, orbit: Shape) -> Iterator[Layer]:
        """Return the orbit's fat, its muscles and its gland, the optic nerve, and the eye with its lens."""
        vary = self.vary
        x, y, z = s * vary(31.5, 0.5), vary(67.5, 1.0), vary(38, 0.6)
        radius, gaze = vary(12.2, 0.3), vary(0.0, 0.1)
        yield Layer(orbit, FAT)
        yield Layer(ellipsoid((x, 79.5, z), (17, 3.0, 13)), SOFT)
        apex: Point = (s * 16.0, 31.0, 40.0)
        for across, up in ((-11.5, 0.0), (11.5, 0.0), (0.0, 11.5), (0.0, -11.5)):
            belly: Point = (s * 24.0 + 0.85 * across, 48.0, 39.5 + 0.8 * up)
            course = [apex, belly, (x + across, y - 3, z + up)]
            yield Layer(tube(course, (1.0, 2.4 if up == 0 else 2.8, 1.0), smoothing=1.5), SOFT)
        nerve: list[Point] = [(s * 14.5, 28, 41), (s * 22, 42, 40), (s * 28, 52, z - 1), (x - s, y - radius + 1, z)]
        yield Layer(tube(nerve, 2.9, smoothing=2.0), FLUID, opacity=0.4)
        yield Layer(tube(nerve, 2.0, smoothing=2.0), _NERVE)
        yield Layer(ellipsoid((s * 46, 66, 47), (4, 8, 6), angle=s * 0.5), SOFT)
        ball, front_x, front_y = (
            ellipsoid((x, y, z), (radius, radius, radius)),
            x + 0.75 * radius * math.sin(gaze),
            y + 0.72 * radius * math.cos(gaze),
        )
        yield Layer(union(ball, ellipsoid((front_x, front_y + 1.2, z), (6, 3.5, 6))), _SCLERA)
        yield Layer(ball.grown(-1.2), _VITREOUS)
        yield Layer(ellipsoid((front_x, front_y + 1.6, z), (5, 2.6, 5)), _VITREOUS)
        yield Layer(ellipsoid((front_x, front_y - 0.4, z), (4.6, 2.1, 4.6), angle=-gaze), _LENS)


def _in_front_of(level: float) -> Shape:
    return Shape(lambda _x, y, _z: level - y, (-200, level, -200), (200, 200, 200))


def _orbit(s: int, vary: Variation) -> Shape:
    return capsule((s * vary(32, 0.6), vary(62, 0.6), 38), (s * 15, 29, 40), vary(17.5, 0.5), 4.0)


def _maxillary(s: int, size: float) -> Shape:
    def corners(share: float) -> list[tuple[float, float]]:
        return [(s * (15 + size * share * (x - 15)), 56 + size * share * (y - 56)) for x, y in _SINUS]

    return outline((-16, corners(0.7)), (2, corners(0.95)), (16, corners(0.9)), (22, corners(0.55)))
