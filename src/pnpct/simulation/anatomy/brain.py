"""What is inside the skull: the hindbrain, the nuclei, the fluid, the membranes and the vessels."""

from collections.abc import Iterator

import numpy as np

from pnpct.simulation.anatomy.cerebrum import GREY, WHITE, Cerebrum
from pnpct.simulation.anatomy.folds import random_folds
from pnpct.simulation.anatomy.painted_body import Layer
from pnpct.simulation.anatomy.shapes import Array, Point, Shape, capsule, ellipsoid, loft, tube, union
from pnpct.simulation.anatomy.skull_base import BLOOD, FLUID, SIDES
from pnpct.simulation.anatomy.tissues import Tissue
from pnpct.simulation.anatomy.variation import Variation

_DURA = Tissue({"muscle": 0.99, "cortical bone": 0.01})
_PALLIDUM = Tissue({"brain grey matter": 0.75, "brain white matter": 0.25})
_CALCIFIED = Tissue({"muscle": 0.82, "cortical bone": 0.18})
_STEM = Tissue({"brain grey matter": 0.35, "brain white matter": 0.65})
_CEREBELLUM = Tissue(
    {"brain grey matter": 1.0}, {"brain white matter": 1.0}, share=0.3, texture={0.9: 0.1, 2.5: 0.1, 9.0: 0.05}
)
# Height, middle and half axes of the brain stem, and of the fluid around it.
# fmt: off
_STEM_STATIONS = (
    (-10, 0, -26, 8, 7), (8, 0, -21, 9, 8), (20, 0, -13, 11, 10), (28, 0, -8, 16, 13), (38, 0, -3, 17, 14),
    (46, 0, -2, 15, 13), (52, 0, -4, 17, 13), (64, 0, -8, 19, 15), (72, 0, -10, 16, 12),
)
_AROUND_STEM = (
    (-10, 0, -30, 17, 17), (10, 0, -24, 19, 17), (30, 0, -12, 19, 18), (44, 0, 0, 18, 17), (52, 0, 2, 18, 18),
    (60, 0, -6, 20, 18), (68, 0, -14, 11, 11),
)
# fmt: on


class Brain:
    """The brain of one patient, its cavities, veins and membranes.

    Args:
        vary: Generator of the variation.
        cavity: Inside of the skull.
    """

    def __init__(self, vary: Variation, cavity: Shape) -> None:
        self.vary, self.cavity = vary, cavity
        self.age = vary.between(0, 1)  # from 0, young, to 1, old
        self.tent_height = vary(43.0, 1.2)
        self.hind = Shape(self._below_the_tent, (-70, -100, 0), (70, 30, 80)).within(cavity)
        self.around_stem = loft(_AROUND_STEM)
        star = [ellipsoid((0, 15, 51), (13, 8, 7)), capsule((0, 20, 52), (0, 36, 54), 3.0, 1.5)]
        star += [tube([(s * 8, 15, 51), (s * 22, 22, 54), (s * 37, 17, 59)], (3.2, 2.0, 1.6)) for s in SIDES]
        self.cisterns = union(self.around_stem, *star, smoothing=3.0)
        room = Shape(self._above_the_tent, cavity.low, cavity.high)
        self.cerebrum = Cerebrum(vary, cavity, room, 0.25 + 0.85 * self.age)

    def layers(self) -> Iterator[Layer]:
        """Return all of it, fluid first."""
        yield Layer(self.cavity, FLUID)
        yield from self.cerebrum.layers()
        yield from self.cerebellum()
        yield from self.stem()
        for s in SIDES:
            yield from self.nuclei(s)
            yield from self.lateral_ventricle(s)
        yield from self.midline()
        yield from self.membranes()
        yield from self.sinuses()
        yield from self.arteries()

    def tent(self, x: Array, y: Array) -> Array:
        """Height of the tentorium, mm: from the edges of the skull it rises to the middle and the front."""
        rise = np.clip((y + 84) / 54, 0, 1) + 0.3 * np.clip((y + 30) / 40, 0, 1)
        height: Array = self.tent_height + 27 * rise * np.maximum(1 - np.abs(x) / 50, 0) ** 0.8
        return height

    def _before_the_tent(self, x: Array, y: Array) -> Array:
        """The ridges of the petrous bones, where it ends."""
        front: Array = (y - 8 + 0.5 * np.abs(x)) * 0.9
        return front

    def _above_the_notch(self, y: Array, z: float) -> Array:
        """Its free edge around the brain stem, which falls towards the front."""
        return 0.9 * (z - 72) + 0.4 * (y + 36)

    def _below_the_tent(self, x: Array, y: Array, z: float) -> Array:
        ends = np.maximum(self._before_the_tent(x, y), self._above_the_notch(y, z))
        distance: Array = np.maximum(ends, (z - self.tent(x, y)) * 0.8)
        return distance

    def _above_the_tent(self, x: Array, y: Array, z: float) -> Array:
        below = -self._below_the_tent(x, y, z) - 0.7
        if z < 72:
            below = np.maximum(below, -self.cisterns.distance(x, y, z))
        distance: Array = np.maximum(self.cavity.distance(x, y, z), below)
        return distance

    def cerebellum(self) -> Iterator[Layer]:
        """Two lobes and the vermis between them, with folia around white matter."""
        folia = random_folds(self.vary.generator, 7.0)
        whole = self.hind.grown(-0.6 - 0.5 * self.age)
        in_front = self.around_stem.grown(-6.0).between(-20, 34)
        lobes = whole.without(ellipsoid((0, -84, 20), (6, 12, 40))).without(in_front)

        def fissures(x: Array, y: Array, z: float) -> Array:
            wide = folia.distance(0.45 * x, 0.9 * y, 1.5 * z) - 0.25 - 0.35 * self.age
            distance: Array = np.maximum(np.maximum(wide, -whole.distance(x, y, z) - 9), lobes.distance(x, y, z))
            return distance

        yield Layer(lobes, _CEREBELLUM)
        yield Layer(whole.grown(-9.0).without(self.around_stem), WHITE, opacity=0.7)
        yield Layer(Shape(fissures, whole.low, whole.high), FLUID, opacity=0.3)
        yield Layer(ellipsoid((0, -48, 48), (7, 22, 18)).within(whole), GREY, opacity=0.6)

    def stem(self) -> Iterator[Layer]:
        """Medulla, pons, midbrain and their arms to the cerebellum; the fourth ventricle and the aqueduct."""
        arms = [capsule((s * 13, -6, 36), (s * 26, -34, 36), 7.0) for s in SIDES]
        yield Layer(union(*arms, loft(_STEM_STATIONS, power=2.3), smoothing=6.0), _STEM)
        for s in SIDES:
            yield Layer(ellipsoid((s * 6, -6, 60), (3.5, 3, 4)), GREY, opacity=0.5)
        size = 0.85 + 0.4 * self.age
        yield Layer(ellipsoid((0, 12, 56), (4, 8, 9)), FLUID)
        yield Layer(ellipsoid((0, -23, 33), (8 * size, 5.5 * size, 11), power=2.3), FLUID)
        yield Layer(capsule((0, -21, 40), (0, -18, 64), 1.0), FLUID)

    def nuclei(self, s: int) -> Iterator[Layer]:
        """Return putamen and pallidum, the caudate nucleus and the thalamus of one side."""
        vary = self.vary
        yield Layer(ellipsoid((s * vary(27.5, 0.7), vary(8, 1), 71), (5.5, 17, 12), angle=s * 0.2), GREY)
        yield Layer(ellipsoid((s * 20.5, 4, 69), (4.5, 10, 8), angle=s * 0.55), _PALLIDUM)
        tail: list[Point] = [(s * 13.5, 28, 77), (s * 16, 12, 88), (s * 20, -14, 92), (s * 25, -26, 88)]
        yield Layer(tube(tail, (6.0, 4.0, 2.5, 1.6)), GREY)
        yield Layer(ellipsoid((s * 13.5, 27, 75), (5.5, 9, 10), angle=-s * 0.3), GREY)
        yield Layer(ellipsoid((s * 11.0, -11, 75), (9.0, 15, 10), angle=s * 0.45), GREY, opacity=0.9)

    def lateral_ventricle(self, s: int) -> Iterator[Layer]:
        """Return the body and the three horns of one side, and its choroid plexus."""
        vary = self.vary
        wide = (0.65 + 0.75 * self.age) * vary(1.0, 0.1)

        def part(points: list[tuple[float, float, float]], *radii: float) -> Shape:
            return tube([(s * x, y, z) for x, y, z in points], [wide * radius for radius in radii], smoothing=3.0)

        front = ellipsoid((s * 7.5, 33, 79), (3.0 * wide, 15, 12), angle=-s * 0.3)
        body = part([(7, 28, 84), (9, 10, 91), (12, -12, 93), (19, -30, 88), (25, -38, 78)], 3.2, 4.0, 4.2, 5.0, 6.0)
        behind = part([(25, -38, 78), (25, -50, 74), (vary(22, 2), vary(-62, 4), 72)], 5.5, 3.6, 1.2)
        below = part([(26, -37, 77), (31, -26, 64), (32, -8, 54), (28, 6, 50)], 4.5, 2.8, 1.6, 1.8)
        yield Layer(union(front, body, behind, below, smoothing=4.0), FLUID)
        plexus = (s * 24.5, -39.0, 78.0)
        yield Layer(ellipsoid(plexus, (2.5, 5, 5)), BLOOD, opacity=0.8)
        if vary.between(0, 1) < 1.3 * self.age - 0.2:
            size = vary.between(0.6, 1.3)
            yield Layer(ellipsoid(plexus, (1.7 * size, 2.6 * size, 3 * size)), _CALCIFIED, opacity=0.8)

    def midline(self) -> Iterator[Layer]:
        """The third ventricle, the cistern behind it and the pineal gland."""
        yield Layer(ellipsoid((0, -3, 71), (0.7 + 2.2 * self.age, 15, 10), power=2.5), FLUID)
        yield Layer(ellipsoid((0, -27, 69), (9, 4.5, 6)), FLUID)
        yield Layer(ellipsoid((0, -26, 70), (3, 3.5, 3)), GREY)
        if self.vary.between(0, 1) < 0.4 + 0.5 * self.age:
            yield Layer(ellipsoid((0, -26, 70), (self.vary(1.7, 0.3), self.vary(1.9, 0.4), 2.2)), _CALCIFIED)

    def membranes(self) -> Iterator[Layer]:
        """The falx between the hemispheres and the tentorium over the cerebellum."""
        callosum = ellipsoid((0, 2, 72), (100, 42, 30))
        inside = self.cavity.grown(0.3)

        def falx(x: Array, y: Array, z: float) -> Array:
            ends = np.maximum(-callosum.distance(x, y, z), self.tent(0 * x, y) - z)
            distance: Array = np.maximum(np.abs(x) - 0.75, ends)
            return distance

        def tentorium(x: Array, y: Array, z: float) -> Array:
            notch = 1 - np.hypot(x / 18, (y + 2) / 34)
            ends = np.maximum(self._before_the_tent(x, y), self._above_the_notch(y, z))
            distance: Array = np.maximum(np.abs(z - self.tent(x, y)) * 0.75 - 0.4, np.maximum(15 * notch, ends))
            return distance

        yield Layer(Shape(falx, (-2, -100, 44), (2, 100, 145)).within(inside), _DURA, opacity=0.85)
        yield Layer(Shape(tentorium, (-70, -100, 38), (70, 20, 76)).within(inside), _DURA, opacity=0.85)

    def sinuses(self) -> Iterator[Layer]:
        """The channels in the dura that carry the blood away."""
        inside = self.cavity.grown(1.0)
        for s in SIDES:
            size = self.vary(3.0, 0.6)
            course = [(0, -83, 47), (25, -78, 44), (48, -58, 42), (57, -38, 41), (52, -30, 30), (40, -24, 16)]
            transverse = tube([(s * x, y, z) for x, y, z in course], (4.0, size, size, size, 3.6, 3.8), smoothing=2.0)
            yield Layer(transverse.within(inside), BLOOD)
        yield Layer(tube([(0, -30, 73), (0, -55, 62), (0, -82, 48)], 2.2), BLOOD)

        def sagittal(x: Array, y: Array, z: float) -> Array:
            depth = -self.cavity.distance(x, y, z)
            triangle = np.maximum(np.abs(x) - 5.5 + 0.9 * np.maximum(depth, 0), depth - 6)
            distance: Array = triangle + max(0.0, (60 - z) / 4) * (y > 0)
            return distance

        yield Layer(Shape(sagittal, (-7, -100, 46), (7, 100, 145)).within(inside), BLOOD)

    def arteries(self) -> Iterator[Layer]:
        """The basilar artery, the carotids, and those that come from them at the base of the brain."""
        yield Layer(tube([(0, 12, 20), (1, 16, 38), (0, 16, 50)], 1.6).within(self.cavity), BLOOD)
        courses: tuple[tuple[float, list[Point]], ...] = (
            (2.0, [(8, 22, 40), (9, 18, 48), (9, 16, 54)]),
            (1.1, [(9, 16, 52), (15, 17.5, 53), (22, 22, 54), (30, 20, 57), (39, 15, 62)]),
            (1.1, [(9, 17, 54), (2, 28, 57), (1.5, 42, 66)]),
            (1.1, [(0, 16, 50), (14, 6, 54), (22, -12, 57)]),
        )
        for s in SIDES:
            for radius, course in courses:
                artery = tube([(s * x, y, z) for x, y, z in course], radius)
                yield Layer(artery.within(self.cavity), BLOOD)
