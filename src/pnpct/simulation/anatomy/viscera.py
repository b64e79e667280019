"""The solid organs of the abdomen: liver, gall bladder, spleen, pancreas, kidneys and adrenal glands."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pnpct.simulation.anatomy.contrast import Contrast
from pnpct.simulation.anatomy.painted_body import Layer
from pnpct.simulation.anatomy.room import Room, as_point, tree
from pnpct.simulation.anatomy.sections import outline, sheet, shell
from pnpct.simulation.anatomy.shapes import Array, Point, Shape, capsule, ellipsoid, tube, union
from pnpct.simulation.anatomy.tissues import CORTICAL_BONE, FAT, MUSCLE, Tissue, blood, perfused
from pnpct.simulation.anatomy.variation import Variation

BILE = Tissue({"water": 0.82, "muscle": 0.18})
URINE = Tissue({"water": 0.9, "muscle": 0.1})
FLUID = Tissue({"water": 0.85, "muscle": 0.15})

# Where the liver ends towards the front, the middle and the back, from front to back, at heights in mm.
_LIVER = (
    (
        -62.0,
        [(-175, 95), (-170, 72), (-166, 62), (-163, 55), (-163, 50), (-164, 44), (-166, 38), (-170, 30), (-176, 10)],
    ),
    (
        -30.0,
        [(-140, 140), (-132, 76), (-128, 62), (-126, 52), (-127, 40), (-129, 28), (-133, 14), (-141, -2), (-165, -20)],
    ),
    (
        0.0,
        [
            (-125, 140),
            (-112, 84),
            (-106, 64),
            (-104, 42),
            (-106, 25),
            (-111, 8),
            (-119, -12),
            (-131, -34),
            (-150, -140),
        ],
    ),
    (28.0, [(-62, 140), (-52, 92), (-58, 56), (-70, 27), (-64, 12), (-70, -3), (-90, -22), (-112, -55), (-126, -140)]),
    (55.0, [(-20, 140), (14, 96), (22, 62), (10, 34), (-30, 16), (-8, 2), (-32, -18), (-64, -60), (-95, -140)]),
    (82.0, [(18, 140), (56, 92), (40, 54), (14, 34), (-6, 16), (-4, -4), (-30, -30), (-58, -75), (-86, -140)]),
    (115.0, [(50, 140), (84, 80), (64, 52), (34, 36), (8, 16), (-8, -8), (-22, -36), (-48, -75), (-80, -140)]),
)
_SPLEEN = (
    (-32.0, [(128, -22), (131, -18), (134, -16), (138, -14), (140, -18), (139, -24), (135, -27), (131, -26)]),
    (-8.0, [(112, -32), (116, -22), (122, -14), (137, 2), (146, -12), (143, -38), (132, -54), (118, -48)]),
    (25.0, [(78, -30), (92, -18), (106, -24), (144, 14), (156, -14), (146, -56), (116, -84), (88, -58)]),
    (58.0, [(58, -38), (74, -22), (100, -26), (144, 22), (158, -10), (146, -58), (98, -90), (64, -72)]),
    (92.0, [(58, -56), (74, -28), (100, -14), (136, 24), (158, -10), (142, -62), (104, -92), (70, -84)]),
    (118.0, [(62, -58), (78, -36), (100, -22), (128, 8), (146, -20), (132, -62), (104, -86), (72, -80)]),
)


@dataclass(frozen=True)
class Viscera:
    """The organs of one patient.

    Args:
        vary: Generator of the variation.
        contrast: Iodine at the time of the scan.
        inside: What the diaphragm and the wall of the abdomen enclose.
    """

    vary: Variation
    contrast: Contrast
    inside: Shape

    def liver(self) -> tuple[Shape, list[Layer]]:
        """Return the liver's outline, and its layers with vessels and lesions."""
        vary, contrast = self.vary, self.contrast
        left, tall = vary(1.0, 0.22), vary(1.0, 0.1)
        shift = (vary(0, 6), vary(0, 5))
        stations = []
        for z, inner in _LIVER:
            moved = [(x + shift[0] + (left - 1) * max(x + 60, 0), y + shift[1]) for x, y in inner]
            stations.append((60 + tall * (z - 60), [*moved, (-260.0, -150.0), (-260.0, 150.0)]))
        whole = outline(*stations).within(self.inside.grown(-2.0))
        x, low = vary(-38, 6), vary(20, 8)
        cleft = [(x + 4, vary(36, 6), 0.6), (x + vary(0, 3), 66, vary(1.0, 0.3)), (x + 8, 120, vary(2.2, 0.8))]
        fissure = sheet((low, cleft), (vary(78, 6), cleft))
        tissue = perfused("liver", contrast.liver, fat=max(vary(0.03, 0.06), 0.0))
        layers = [Layer(whole.grown(1.5), FAT, 0.6), Layer(whole, tissue)]
        layers.append(Layer(fissure.within(whole), FAT, 0.9))
        room = Room(whole)
        root, behind = (-46.0, 16.0, 48.0), (-30.0, -16.0, 98.0)
        for heading, radius in (((-1, 0.3, 0.3), 5.2), ((-0.9, -0.5, -0.3), 4.6), ((0.5, 0.7, 0.5), 4.0)):
            for piece, thick in tree(root, heading, vary(radius, 0.4), room, vary, thinnest=0.8, spread=0.6):
                layers.append(Layer(piece, blood(contrast.portal), min(0.45 + 0.3 * thick, 1.0)))
        for heading, radius in (((-1, -0.1, -0.5), 4.6), ((-0.5, 0.9, -0.5), 4.2), ((0.6, 0.8, -0.3), 3.8)):
            for piece, thick in tree(behind, heading, vary(radius, 0.4), room, vary, thinnest=0.8, spread=0.6):
                layers.append(Layer(piece, blood(0.95 * contrast.veins), min(0.45 + 0.3 * thick, 1.0)))
        for _ in range(int(vary.between(0, 1) ** 2 * 7)):
            layers += self.lesion(room)
        return whole, layers

    def lesion(self, room: Room) -> Iterator[Layer]:
        """Return a cyst, a metastasis or a haemangioma somewhere in the liver."""
        vary, contrast = self.vary, self.contrast
        radius = vary.between(3.0, 15.0)
        center = room.draw(vary.generator, radius + 2)
        around = ellipsoid(center, (radius, vary(radius, 0.12 * radius), vary(radius, 0.12 * radius)), angle=vary(0, 1))
        kind = vary.between(0, 1)
        if kind < 0.4:
            yield Layer(around, FLUID)
        elif kind < 0.75:
            yield Layer(around.grown(1.5), perfused("liver", 0.8 * contrast.liver), 0.7)
            yield Layer(around, perfused("muscle", 0.45 * contrast.liver, grain=0.02))
            yield Layer(around.grown(-0.45 * radius), perfused("muscle", 0.2 * contrast.liver), 0.6)
        else:
            yield Layer(around, perfused("muscle", 0.35 * contrast.liver))
            for _ in range(6):
                away = vary.generator.standard_normal(3)
                spot = np.array(center) + 0.78 * radius * away / np.linalg.norm(away)
                yield Layer(ellipsoid(as_point(spot), (0.3 * radius,) * 3).within(around), blood(0.9 * contrast.veins))

    def gall_bladder(self) -> Iterator[Layer]:
        """Return the gall bladder, with stones in some patients."""
        vary = self.vary
        neck, fundus = (vary(-62, 3), vary(34, 3), 24.0), (vary(-92, 5), vary(70, 5), vary(-6, 6))
        bladder = capsule(neck, fundus, 5.0, vary(13.0, 2.5))
        yield Layer(bladder.grown(1.6), perfused("muscle", self.contrast.wall))
        yield Layer(bladder, BILE)
        if vary.between(0, 1) < 0.15:
            for number in range(int(vary.between(1, 5))):
                size = vary.between(2.0, 6.0)
                spot = (fundus[0] + vary(0, 3), fundus[1] - 12 + size + vary(0, 0.5), fundus[2] + 7 * (number - 1))
                stone = ellipsoid(spot, (size, size, size), power=2.5).within(bladder)
                yield Layer(stone, Tissue({"muscle": 0.9, "cortical bone": 0.1}))
                yield shell(stone, 1.4, CORTICAL_BONE, opacity=0.5)

    def spleen(self) -> list[Layer]:
        """Return the spleen and the vessels at its hilum."""
        vary, early = self.vary, max(self.contrast.arteries - 0.45, 0.0)
        size, shift = vary(1.0, 0.05), (vary(0, 3), vary(0, 4))
        stations = [
            (
                30 + size * (z - 30),
                [(115 + size * (x - 115) + shift[0], size * (y + 30) - 30 + shift[1]) for x, y in ring],
            )
            for z, ring in _SPLEEN
        ]
        whole = outline(*stations).within(self.inside.grown(-2.5))
        grains = {0.9: 0.012, 2.5: 0.012, 9.0: 0.01 + 0.2 * early}
        tissue = Tissue({"spleen": 1.0}, {"iodinated blood": 1.0}, share=self.contrast.spleen, texture=grains)
        layers = [Layer(whole.grown(1.5), FAT, 0.6), Layer(whole, tissue)]
        if vary.between(0, 1) < 0.25:  # an accessory spleen
            layers.append(Layer(ellipsoid((vary(88, 6), vary(0, 6), vary(20, 15)), (6, 6, 6)), tissue))
        for turn in (-0.6, 0.0, 0.5):
            start, end = (84.0, -6.0, 40.0), (104 + vary(0, 4), -22 + 24 * turn, 40 + 44 * turn)
            layers.append(
                Layer(tube([start, (94, -6 + 10 * turn, 40 + 20 * turn), end], 2.6), blood(self.contrast.portal))
            )
        return layers

    def pancreas(self) -> Iterator[Layer]:
        """Return head, body and tail, lobulated, with duct, bile duct and the vein behind them."""
        vary, (dx, dy) = self.vary, (self.vary(0, 3), self.vary(0, 4))
        line: Sequence[Point] = [
            (-40 + dx, 30 + dy, -22), (-36 + dx, 36 + dy, 2), (-16 + dx, 46 + dy, 18), (12 + dx, 48 + dy, 28),
            (44 + dx, 30 + dy, 36), (72 + dx, 8 + dy, 42), (88 + dx, -4 + dy, 46),
        ]  # fmt: skip
        stout = vary(1.0, 0.15)
        body = tube(line, [stout * r for r in (10, 14, 10, 9, 9.5, 9, 6)], smoothing=4.0)
        iodine = self.contrast.pancreas
        lobules = Tissue(
            {"pancreas": 1 - iodine, "iodinated blood": iodine},
            {"adipose": 1.0},
            share=vary.between(-0.1, 0.12),
            texture={0.9: 0.06, 2.5: 0.22},
        )
        yield Layer(body.grown(1.5), FAT)
        yield Layer(body, lobules)
        yield Layer(tube(line[1:], vary.between(0.6, 1.4)), FLUID, 0.8)
        yield Layer(capsule((-46 + dx, 30 + dy, -20), (-48, 28, 44), vary.between(2.0, 3.6)), BILE)
        vein: Sequence[Point] = [(-12 + dx, 34 + dy, 16), (14 + dx, 36 + dy, 26), (46 + dx, 18 + dy, 35), (86, -6, 42)]
        yield Layer(tube(vein, (5.0, 4.4, 4.0, 3.4), smoothing=3.0), blood(self.contrast.portal))

    def kidney(self, side: int) -> Iterator[Layer]:
        """Return a kidney: cortex, medulla, fat in its middle, pelvis, vessels, and the fascia around it."""
        vary, contrast = self.vary, self.contrast
        x, y, z = side * vary(76, 3), vary(-34 if side < 0 else -30, 4), vary(-14 if side < 0 else 0, 8)
        size, turn = vary(1.0, 0.06), vary(0.6, 0.12)
        a, b, c = 24 * size, 32 * size, 56 * size
        to_hilum, across = (-side * math.cos(turn), math.sin(turn)), (-math.sin(turn), -side * math.cos(turn))

        def place(u: float, v: float, w: float) -> Point:
            """From the kidney's own axes: to the hilum, across, up; the upper pole leans inwards and back."""
            return (
                x + u * to_hilum[0] + v * across[0] - side * 0.22 * w,
                y + u * to_hilum[1] + v * across[1] - 0.18 * w,
                z + w,
            )

        def part(u: float, half_axes: Point) -> Shape:
            middle = (x + u * to_hilum[0], y + u * to_hilum[1], z)
            angle = math.atan2(to_hilum[1], to_hilum[0])
            return _leaning(ellipsoid(middle, half_axes, angle=angle), z, -side * 0.22, -0.18)

        whole = part(0.0, (a, b, c))
        yield shell(whole.grown(vary(13, 3)), 1.0, MUSCLE, opacity=0.35)
        yield Layer(whole, perfused("kidney", contrast.cortex, grain=0.015))
        medulla = perfused("kidney", contrast.medulla, grain=0.015)
        for up in (-0.68, -0.4, -0.12, 0.16, 0.44, 0.7):
            wide = math.sqrt(1 - up**2)
            for turned in (-1.8, -0.9, 0.0, 0.9, 1.8):
                tip = turned + vary(0, 0.12)
                u, v = -math.cos(tip) * a * wide, math.sin(tip) * b * wide
                pyramid = capsule(place(0.3 * u, 0.3 * v, 0.85 * up * c), place(0.68 * u, 0.68 * v, up * c), 2.0, 6.0)
                yield Layer(pyramid.within(whole.grown(-5.0)), medulla)
        yield Layer(
            union(
                part(0.45 * a, (0.72 * a, 0.36 * b, 0.5 * c)),
                part(1.1 * a, (0.6 * a, 0.34 * b, 0.26 * c)),
                smoothing=5.0,
            ),
            FAT,
        )
        full = vary.between(0.5, 1.3)
        stem = place(1.7 * a, 2, -16)
        pelvis = [tube([place(0.4 * a, -2, 0), place(1.1 * a, 0, -4), stem], (4 * full, 5 * full, 2.5))]
        for up in (-0.38, -0.12, 0.14, 0.4):
            end = place(vary(-0.05, 0.05) * a, vary(0, 5), up * c)
            pelvis.append(capsule(place(0.4 * a, -2, 0), end, 2.2 * full, 3.2 * full))
        ureter = tube([stem, (side * 42, -22, z - 50), (side * 40, -16, -105)], 2.2)
        yield Layer(union(*pelvis, ureter, smoothing=3.0), URINE)
        for up in (-0.3, 0.05, 0.33):
            spot = place(0.15 * a, vary(6, 3), up * c)
            yield Layer(capsule(place(1.4 * a, 3, 4), spot, 2.8, 1.3), blood(contrast.veins))
            yield Layer(capsule(place(1.4 * a, 0, 6), spot, 1.6, 1.0), blood(contrast.arteries))
        if vary.between(0, 1) < 0.3:
            radius = vary.between(3, 16)
            yield Layer(ellipsoid(place(-0.8 * a, vary(0, 0.5 * b), vary(0, 0.5 * c)), (radius,) * 3), FLUID)

    def adrenal(self, side: int) -> Iterator[Layer]:
        """Return an adrenal gland: a thin Y."""
        x, y = side * self.vary(36, 2), self.vary(-18, 2)
        tissue = perfused("muscle", 0.8 * self.contrast.spleen)
        for turn in (-4.0, 9.0):
            low = [(x, y + 2, 1.4), (x + side * turn, y - 11, 1.1)]
            high = [(x - side, y + 4, 2.4), (x + side * 0.6 * turn, y - 9, 1.6)]
            yield Layer(sheet((30.0, low), (44.0, high), (58.0, high)), tissue)


def _leaning(shape: Shape, height: float, x: float, y: float) -> Shape:
    """The solid, moved by x and y for every mm above a height."""

    def distance(px: Array, py: Array, pz: float) -> Array:
        return shape.distance(px - x * (pz - height), py - y * (pz - height), pz)

    low, high = shape.low, shape.high
    reach = max(high[2] - height, height - low[2])
    wide, deep = abs(x) * reach, abs(y) * reach
    return Shape(distance, (low[0] - wide, low[1] - deep, low[2]), (high[0] + wide, high[1] + deep, high[2]))
