"""A procedural abdomen, from the crests of the hips to the diaphragm."""

import itertools
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from pnpct.simulation.anatomy.bowel import Bowel, colon, folded, haustra, juice, painted, small_bowel, smooth_line
from pnpct.simulation.anatomy.contrast import drawn_contrast
from pnpct.simulation.anatomy.lumbar import BENDING, back, great_vessels
from pnpct.simulation.anatomy.painted_body import Layer, PaintedBody
from pnpct.simulation.anatomy.room import Room, as_point
from pnpct.simulation.anatomy.sections import shell
from pnpct.simulation.anatomy.shapes import Array, Point, Shape, capsule, ellipsoid, loft, tube, union
from pnpct.simulation.anatomy.skeleton import Rib
from pnpct.simulation.anatomy.tissues import FAT, MUSCLE, SKIN, Tissue, blood, perfused
from pnpct.simulation.anatomy.variation import Variation
from pnpct.simulation.anatomy.viscera import Viscera

LOWEST, HIGHEST = -100.0, 100.0


def abdomen_body(generator: np.random.Generator) -> PaintedBody:
    """Build an adult's abdomen: liver, kidneys, spleen, pancreas, bowel, vessels, muscles, spine, fat and skin.

    Sizes, positions, the fat under the skin (slim to obese), the filling of the bowel, the time of the contrast
    medium, lesions of the liver and all textures vary with the generator; one seed gives one patient. The second
    lumbar vertebra is at z = 0, the domes of the diaphragm are above the upper end.

    Args:
        generator: Generator of the variation; a given state gives the same patient.

    Returns:
        The body, 315 to 430 mm wide, in supine position: front at +y, the patient's left at +x.

    Example:
        >>> from pnpct.geometry import ImageGrid
        >>> body = abdomen_body(np.random.default_rng(1))
        >>> body.slice(0.0, ImageGrid(64, 64, spacing=7.0)).grid.shape
        (64, 64)
    """
    patient = _Abdomen(generator)
    return PaintedBody(tuple(patient.layers()), LOWEST, HIGHEST, seed=patient.vary.seed(), bending=BENDING)


class _Abdomen:
    """One patient; positions in mm from the middle of the abdomen."""

    def __init__(self, generator: np.random.Generator) -> None:
        self.vary = vary = Variation(generator)
        self.contrast = drawn_contrast(vary)
        weight = vary.between(0, 1) ** 1.3  # from 0, slim, to 1, obese
        wide, deep = vary(0.96 + 0.12 * weight, 0.02), vary(0.94 + 0.2 * weight, 0.03)
        fat = vary(7 + 26 * weight, 2)

        def under_the_skin(x: Array, y: Array, _: float) -> Array:
            flank = _bump((np.abs(x) - 100) / 80)
            even = fat * (0.85 + 0.2 * _rise(y / 60) + 0.5 * _rise(-y / 60) * flank)
            return even + 2 + 6.0 * _rise(-y / 60) * _bump((np.abs(x) - 108) / 50)

        stations = ((-140, 10, 142, 90), (-60, 12, 146, 94), (0, 14, 150, 97), (60, 14, 148, 96), (140, 10, 138, 88))
        self.cavity = loft([(z, 0.0, y + 97 * (deep - 1), a * wide, b * deep) for z, y, a, b in stations], power=2.5)
        self.muscles = _around(self.cavity, lambda x, y, _: 11.0 + 23.0 * _bump(x / 88) * _rise(-(y + 20) / 30))
        self.body = _around(self.muscles, under_the_skin)
        self.fascia = _around(self.muscles, lambda x, y, z: 0.45 * under_the_skin(x, y, z))
        # Under the diaphragm; between it and the ribs are the lowest parts of the lungs.
        self.inside = _around(self.cavity, _recess)
        self.wall_of_bowel = perfused("muscle", self.contrast.wall, grain=0.02)

    def layers(self) -> Iterator[Layer]:
        viscera = Viscera(self.vary, self.contrast, self.inside)
        yield from self.wall()
        yield from self.ribs_and_diaphragm()
        for side in (-1, 1):
            yield from viscera.kidney(side)
            yield from viscera.adrenal(side)
        liver, of_liver = viscera.liver()
        tracts = [*self.colon(), *self.stomach()]
        loops = list(self.small_bowel(liver, tracts))
        branches, trunks = great_vessels(self.vary, self.contrast)
        yield from self.mesentery([point for loop in loops for point in loop.points])
        yield from viscera.pancreas()
        yield from viscera.spleen()
        yield from branches
        yield from of_liver
        yield from viscera.gall_bladder()
        yield from painted([*tracts, *loops])
        yield from back(self.vary, self.muscles)
        yield from trunks

    def wall(self) -> Iterator[Layer]:
        """Skin, fat and three flat muscles with fat between them; the straight muscle in front."""
        cavity, low, high = self.cavity, self.muscles.low, self.muscles.high
        yield Layer(self.body, SKIN)
        yield Layer(self.body.grown(-1.8), FAT)
        yield shell(self.fascia, 0.7, MUSCLE, opacity=0.3)
        yield Layer(self.muscles, FAT)

        def flat(depth: float, thick: float) -> Shape:
            def distance(x: Array, y: Array, z: float) -> Array:
                beside = np.maximum(62 - np.abs(x), 0.0) * (y > 0) * 0.25 + np.maximum(-60 - y, 0.0) * 0.25
                flat: Array = beside + np.abs(cavity.distance(x, y, z) - depth) - (thick / 2 + 0.3)
                return flat

            return Shape(distance, low, high)

        def straight(side: int, thick: float) -> Shape:
            def distance(x: Array, y: Array, z: float) -> Array:
                across = (np.abs(side * x - 37) / 31) ** 3
                lens: Array = across * (thick / 2) + np.abs(cavity.distance(x, y, z) - 5.5) - 0.55 * thick
                return lens + 50.0 * (y < 0)

            return Shape(distance, low, high)

        for depth, thick in ((1.7, 2.6), (5.2, 3.4), (9.2, 2.8)):
            yield Layer(flat(depth, self.vary(thick, 0.2)), MUSCLE)
        thick = self.vary(9.0, 1.2)
        for side in (-1, 1):
            yield Layer(straight(side, thick), MUSCLE)
        yield Layer(cavity, FAT)
        yield shell(cavity, 1.0, MUSCLE, opacity=0.5)

    def ribs_and_diaphragm(self) -> Iterator[Layer]:
        """The lower ribs, and the lungs behind the diaphragm."""
        vary, cage = self.vary, self.cavity.grown(1.5)
        yield Layer(cage.grown(9.0).without(self.cavity).between(48.0, 140.0), MUSCLE)
        ribs = ((68, 55, -0.75), (96, 78, -0.15), (124, 95, 0.55), (150, 105, 0.75), (176, 108, 0.8), (202, 108, 0.85))
        for number, (height, drop, last) in enumerate(ribs):
            for side in (-1, 1):
                rib = Rib(cage, side, height + vary(0, 2), vary(drop, 4), first=-1.15, last=vary(last, 0.06))
                layers = list(rib.layers())
                # The last two end without cartilage.
                yield from layers[1:] if number < 2 else layers
        lung = Tissue({"lung": 1.0}, {"air": 1.0}, share=0.3, texture={0.9: 0.06, 2.5: 0.06, 12.0: 0.04}, gravity=0.001)
        yield Layer(self.cavity.grown(-0.5).between(43.0, 140.0), lung)
        yield Layer(ellipsoid((0, -58, 0), (37, 38, 1e3)).between(-140, 140).within(self.cavity), FAT)
        yield Layer(self.inside, MUSCLE)
        yield Layer(self.inside.grown(-2.2), FAT)

    def small_bowel(self, liver: Shape, others: Sequence[Bowel]) -> Iterator[Bowel]:
        """Loops wherever there is room, in some patients with contrast medium that was drunk."""
        vary = self.vary
        front = Shape(lambda x, y, _: -10 - y + 0 * x, (-1e3, -10.0, -110.0), (1e3, 1e3, 62.0))
        mesenteric = tube([(10, 0, 26), (4, 22, 8), (0, 32, -20), (-10, 34, -70)], (9.0, 11.0, 12.0, 10.0))
        room = Room(self.inside.grown(-4.0).within(front).without(union(liver.grown(3.0), mesenteric)))
        oral = vary.between(0.3, 0.9) if vary.between(0, 1) < 0.2 else 0.0
        filled = vary.between(0.2, 0.6) + (0.3 if oral else 0.0)
        yield from small_bowel(room, others, self.wall_of_bowel, vary, filled=filled, oral=oral)

    def colon(self) -> Iterator[Bowel]:
        """From the caecum to the descending colon, with stool and gas."""
        vary, front = self.vary, self.cavity.high[1]
        deep = vary(0, 8)
        corners: list[Point] = [
            (-96, 18, -112), (-102 + vary(0, 4), 10, -70), (-106, 4, -30), (-98, 16, -14), (-82, 46, -12),
            (-58, front - 34, -18 + deep), (-15, front - 28, -34 + 2 * deep), (40, front - 30, -24 + 2 * deep),
            (84, front - 46, 10 + deep), (112, 30, 46), (124, -4, 52), (126, -14, 22), (122, -6, -20),
            (118, -4, -70), (112, 4, -112),
        ]  # fmt: skip
        points = smooth_line(corners, 4.0)
        sizes = np.interp(np.linspace(0, 1, len(points)), (0, 0.2, 0.35, 0.6, 0.72, 1.0), (25, 23, 19, 17, 13, 12))
        radii = [size / 20 * r for size, r in zip(sizes, haustra(points, 20.0, vary), strict=True)]
        yield from colon(points, radii, self.wall_of_bowel, vary)

    def stomach(self) -> Iterator[Bowel]:
        """Stomach and duodenum."""
        vary, front = self.vary, self.cavity.high[1]
        full = vary.between(0.65, 1.15)
        corners: list[Point] = [
            (50, -18, 112), (62, -4, 92), (68, 22, 70), (58, front - 62, 46), (28, front - 52, 26),
            (-8, front - 54, 16), (-34, 58, 20),
        ]  # fmt: skip
        points = smooth_line(corners, 6.0)
        sizes = np.interp(np.linspace(0, 1, len(points)), (0, 0.3, 0.6, 0.85, 1.0), (40, 39, 27, 17, 11))
        wall = self.wall_of_bowel
        radii = [full * r * vary(1.0, 0.03) for r in sizes]
        meal = Tissue({"water": 0.6, "muscle": 0.4}, {"adipose": 1.0}, share=0.12, texture={0.9: 0.06, 2.5: 0.1})
        content = meal if vary.between(0, 1) < 0.6 else juice()
        yield Bowel(points, radii, wall, vary(4.5, 1.0), content, vary(22, 8))
        low, rise = vary(-52, 5), vary(10, 3)
        bow: list[Point] = [
            (-34, 58, 20), (-54, 42, 12), (-58, 30, -8), (-56, 24, -36), (-36, 20, low), (0, 22, low + rise),
            (28, 16, low + 2 * rise), (38, 30, low + 3 * rise),
        ]  # fmt: skip
        line = smooth_line(bow, 5.0)
        yield Bowel(line, [vary(9.8, 0.7) for _ in line], wall, 2.6, folded(wall), max(vary(-2, 5), 0.0))

    def mesentery(self, loops: Sequence[Point]) -> Iterator[Layer]:
        """Vessels that fan out to the bowel in fat, an artery beside each vein."""
        vary, generator = self.vary, self.vary.generator
        root = np.array([(4.0, 26.0, 6.0), (-6.0, 34.0, -30.0), (-16.0, 32.0, -90.0)])
        for index in generator.permutation(len(loops))[:90].tolist():
            goal = np.array(loops[index])
            share = np.clip((20 - goal[2]) / 80 + 0.25 * generator.standard_normal(), 0.0, 1.0)
            start = np.array([np.interp(share, (0, 0.4, 1), root[:, axis]) for axis in range(3)])
            start[:2] += 0.3 * vary.between(0, 1) * (goal - start)[:2]
            middle = (start + goal) / 2 + 9 * generator.standard_normal(3)
            line = smooth_line([as_point(start), as_point(middle), loops[index]], 9.0)
            radii = np.linspace(vary(1.8, 0.4), 0.6, len(line)).tolist()
            for (a, first), (b, last) in itertools.pairwise(zip(line, radii, strict=True)):
                yield Layer(capsule(a, b, first, last), blood(self.contrast.portal), min(0.3 + 0.4 * first, 1.0))
                begin, end = ((x + 3.0, y + 1.0, z + 2.0) for x, y, z in (a, b))
                yield Layer(capsule(begin, end, 0.6 * first, 0.6 * last), blood(self.contrast.arteries), 0.7)


def _recess(x: Array, y: Array, z: float) -> Array:
    """How far inside the ribs the diaphragm is, negative: most at the back and, higher up, at the sides, mm."""
    back = _rise(-(y + 35) / 35) * (0.1 + 0.9 * _rise((np.abs(x) - 58) / 22))
    side = _bump((y + 10) / 75)
    return -0.42 * max(z - 42, 0.0) * back - 0.16 * max(z - 66, 0.0) * side - 0.06 * max(z - 85, 0.0)


def _around(shape: Shape, thickness: Callable[[Array, Array, float], Array | float]) -> Shape:
    """The solid grown by a thickness that changes from place to place, mm; at most 80."""
    wide = shape.grown(80.0)
    return Shape(lambda x, y, z: shape.distance(x, y, z) - thickness(x, y, z), wide.low, wide.high)


def _bump(u: Array) -> Array:
    """1 around 0, and 0 beyond ±1, softly."""
    square = u * u
    bump: Array = np.exp(-square * square)
    return bump


def _rise(u: Array) -> Array:
    """From 0 below −1 to 1 above 1, softly."""
    rise: Array = 0.5 + 0.5 * np.tanh(1.5 * u)
    return rise
