"""A procedural pelvis, from the last lumbar vertebra to the upper thighs."""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from pnpct.simulation.anatomy.bowel import STOOL, Bowel, colon, folded, haustra, painted, small_bowel, smooth_line
from pnpct.simulation.anatomy.contrast import drawn_contrast
from pnpct.simulation.anatomy.hips import Hip, sacrum
from pnpct.simulation.anatomy.lumbar import BENDING, drawn_marrow
from pnpct.simulation.anatomy.painted_body import Layer, PaintedBody
from pnpct.simulation.anatomy.room import Room
from pnpct.simulation.anatomy.sections import outline, sheet, shell
from pnpct.simulation.anatomy.shapes import Point, capsule, ellipsoid, loft, tube, union
from pnpct.simulation.anatomy.tissues import (
    AIR,
    CARTILAGE,
    CORTICAL_BONE,
    FAT,
    MUSCLE,
    SKIN,
    Tissue,
    blood,
    perfused,
)
from pnpct.simulation.anatomy.variation import Variation

LOWEST, HIGHEST = -95.0, 110.0

# External iliac and femoral artery of the left side.
_ARTERY = ((26, 2, 118), (35, 10, 86), (46, 34, 50), (58, 55, 22), (66, 68, -4), (70, 68, -36), (82, 56, -72),
           (86, 50, -110))  # fmt: skip


def pelvis_body(generator: np.random.Generator) -> PaintedBody:
    """Build an adult's pelvis: hips, sacrum, femurs, muscles, bladder, bowel, vessels, organs of a sex, fat, skin.

    Sizes, positions, the fat under the skin, the filling of bladder and bowel, the time of the contrast medium,
    the sex and all textures vary with the generator; one seed gives one patient, and about one in seven has an
    artificial hip of titanium. The heads of the femurs are at z = 0, the crests of the hips at the upper end.

    Args:
        generator: Generator of the variation; a given state gives the same patient.

    Returns:
        The body, 360 to 430 mm wide, in supine position: front at +y, the patient's left at +x.

    Example:
        >>> from pnpct.geometry import ImageGrid
        >>> body = pelvis_body(np.random.default_rng(1))
        >>> body.slice(0.0, ImageGrid(64, 64, spacing=7.0)).grid.shape
        (64, 64)
    """
    patient = _Pelvis(generator)
    return PaintedBody(tuple(patient.layers()), LOWEST, HIGHEST, seed=patient.vary.seed(), bending=BENDING)


class _Pelvis:
    """One patient; positions in mm from the middle between the hip joints."""

    def __init__(self, generator: np.random.Generator) -> None:
        self.vary = vary = Variation(generator)
        self.contrast = drawn_contrast(vary)
        self.male = vary.between(0, 1) < 0.5
        weight = vary.between(0, 1) ** 1.3
        self.fat = fat = vary(13 + 26 * weight, 2)
        self.bladder = ellipsoid((0, 30, 14), (vary(32, 6), vary(25, 4), vary(25, 6)), power=2.3)
        # fmt: off
        torso = loft([(-80, 0, 8, 130, 66), (-40, 0, 2, 156, 84), (20, 0, -2, 150, 88), (80, 0, -2, 146, 94),
                      (140, 0, 0, 146, 98)], power=2.5)
        thigh = ((-140, 92, 6, 70, 76), (-60, 94, 4, 66, 78), (-10, 104, 0, 58, 70), (40, 107, -4, 40, 50))
        # fmt: on
        thighs = [loft([(z, s * x, y, a, b) for z, x, y, a, b in thigh]) for s in (-1, 1)]
        buttocks = [ellipsoid((s * 66, -62, 0), (72, 52, 105)) for s in (-1, 1)]
        base = union(torso, *thighs, *buttocks, smoothing=24.0)
        deep = -92 + 0.3 * fat
        wedge = [(-24, -240), (-2, deep - 22), (0, deep + 3), (2, deep - 22), (24, -240)]
        cleft = outline((-200, wedge), (20, wedge), (70, [(x, y - 45) for x, y in wedge]))
        self.body = base.grown(fat).without(cleft)
        self.wall = perfused("muscle", self.contrast.wall, grain=0.02)
        self.muscle = replace(MUSCLE, share=vary.between(0.02, 0.12))

    def layers(self) -> Iterator[Layer]:
        vary = self.vary
        yield Layer(self.body, SKIN)
        yield Layer(self.body.grown(-1.8), FAT)
        yield shell(self.body.grown(-0.5 * self.fat), 0.7, MUSCLE, opacity=0.25)
        marrow = drawn_marrow(vary, 0.095)
        metal = (-1 if vary.between(0, 1) < 0.5 else 1) if vary.between(0, 1) < 0.15 else 0
        bulk = vary(1.0, 0.06)
        yield from painted(self.bowel())
        for side in (-1, 1):
            yield from Hip(side, self.body.grown(-4.5), vary, self.muscle, marrow, bulk, metal == side).layers()
        yield from sacrum(self.muscle, marrow)
        yield from self.symphysis()
        yield from self.organs()
        yield from self.rectum()
        yield from self.vessels()

    def symphysis(self) -> Iterator[Layer]:
        """Cartilage between the pubic bones."""
        yield Layer(ellipsoid((0, 50, -38), (self.vary(2.4, 0.3), 10, 18)), CARTILAGE)

    def bowel(self) -> list[Bowel]:
        """Caecum, sigmoid colon, and loops of small bowel."""
        vary = self.vary
        caecum = smooth_line([(-78, 44, 122), (-76, 46, 96), (-66, 46, 72 + vary(0, 6))], 4.0)
        swing = vary(0, 14)
        corners: list[Point] = [
            (98, 40, 122), (90, 48, 92), (70, 54, 66), (42 + swing, 46, 60), (14 + swing, 22, 78), (-16, -2, 66),
            (-8, -22, 60), (2, -36, 50),
        ]  # fmt: skip
        sigmoid = smooth_line(corners, 4.0)
        tracts = [
            *colon(caecum, haustra(caecum, 22.0, vary), self.wall, vary),
            *colon(sigmoid, haustra(sigmoid, vary(12.5, 1.5), vary), self.wall, vary),
        ]
        region = loft([(6, 0, 20, 40, 36), (40, 0, 28, 58, 48), (80, 0, 40, 68, 44), (140, 0, 44, 92, 44)], power=2.3)
        room = Room(region.without(self.bladder.grown(6.0)))
        return [*tracts, *small_bowel(room, tracts, self.wall, vary, filled=vary.between(0.1, 0.7))]

    def rectum(self) -> Iterator[Layer]:
        """Rectum and anal canal."""
        vary = self.vary
        wide = vary.between(0.75, 1.3)
        line = smooth_line([(2, -36, 50), (0, -48, 28), (0, -56, 4), (0, -48, -18), (0, -36, -38), (0, -40, -60)], 5.0)
        sizes = np.interp(np.linspace(0, 1, len(line)), (0, 0.3, 0.55, 0.75, 1), (14, 18, 16, 11, 9)) * wide
        filling, gas = (STOOL if vary.between(0, 1) < 0.7 else AIR), max(vary.between(-15, 20), 0.0)
        upper = round(0.72 * len(line))
        tract = Bowel(line[: upper + 1], sizes[: upper + 1].tolist(), self.wall, vary(4.0, 0.6), filling, gas)
        canal = Bowel(line[upper:], sizes[upper:].tolist(), self.wall, 5.0, folded(self.wall))
        yield from painted([tract, canal])

    def organs(self) -> Iterator[Layer]:
        """Bladder, and prostate and seminal vesicles or womb and ovaries."""
        vary, contrast = self.vary, self.contrast
        thick = vary(3.5, 0.8)
        soft = perfused("muscle", 0.45 * contrast.spleen, grain=0.015)
        yield Layer(self.bladder.grown(thick + 1.5), FAT)
        yield Layer(self.bladder.grown(thick), soft)
        urine = Tissue({"water": 0.9, "muscle": 0.1})
        if contrast.arteries > 0 and vary.between(0, 1) < 0.3:  # medium that the kidneys have let through, at the back
            urine = Tissue(urine.base, {"iodinated blood": 1.0}, share=0.7, gravity=-vary.between(0.015, 0.04))
        yield Layer(self.bladder, urine)
        yield from self.male_organs(soft) if self.male else self.female_organs(soft, urine)
        yield Layer(tube([(0, 10, -20), (0, 10, -44)], 2.2), urine, 0.5)

    def male_organs(self, soft: Tissue) -> Iterator[Layer]:
        """Prostate with some calcifications, seminal vesicles, cords and root of the penis."""
        vary, contrast = self.vary, self.contrast
        size = vary(1.0, 0.14)
        gland = ellipsoid((0, 8, -26), (24 * size, 18 * size, 18 * size))
        yield Layer(gland, perfused("muscle", 0.5 * contrast.spleen, grain=0.03))
        yield Layer(
            ellipsoid((0, 11, -24), (14 * size, 10 * size, 13 * size)),
            perfused("muscle", 0.75 * contrast.spleen, grain=0.05),
            0.7,
        )
        for _ in range(int(vary.between(-3, 5))):
            yield Layer(ellipsoid((vary(0, 8), vary(8, 5), vary(-26, 5)), (1.2, 1.2, 1.5)), CORTICAL_BONE, 0.6)
        for side in (-1, 1):
            vesicle = [(side * 3, -12, 3.0), (side * 16, -14, 4.5), (side * 30, -16, 2.5)]
            yield Layer(sheet((-12.0, vesicle), (4.0, vesicle)), soft)
            yield Layer(
                tube([(side * 42, 74, 20), (side * 26, 76, -20), (side * 16, 66, -60), (side * 14, 60, -110)], 6.0),
                MUSCLE,
                0.75,
            )
            yield Layer(tube([(side * 8, 30, -62), (side * 24, 0, -72)], 6.0), soft)
        yield Layer(
            tube([(0, 4, -44), (0, 14, -64), (0, 54, -84), (0, 74, -110)], (9.0, 11.0, 12.0, 13.0), smoothing=4.0),
            soft,
        )

    def female_organs(self, soft: Tissue, liquid: Tissue) -> Iterator[Layer]:
        """Womb with its mucosa, vagina, and ovaries with follicles."""
        vary, contrast = self.vary, self.contrast
        lean = vary(0, 8)
        womb = ellipsoid((lean, -6, 36), (vary(27, 4), vary(21, 3), vary(28, 4)), angle=vary(0, 0.3))
        yield Layer(womb.grown(2.0), FAT)
        yield Layer(womb, perfused("muscle", 0.9 * contrast.spleen, grain=0.025))
        yield Layer(ellipsoid((lean, -6, 40), (9, 3.5, 16)), perfused("muscle", 0.2 * contrast.spleen), 0.8)
        yield Layer(tube([(lean, -12, 12), (0, -14, -10), (0, 2, -60)], (13.0, 11.0, 8.0)), soft)
        for side in (-1, 1):
            ovary = ellipsoid((side * vary(44, 4), vary(-14, 5), vary(44, 6)), (11, 9, 14), angle=side * 0.5)
            yield Layer(ovary, soft)
            for _ in range(3):
                radius = vary.between(1.5, 5.0)
                spot = (side * vary(44, 4), vary(-14, 4), vary(44, 5))
                yield Layer(ellipsoid(spot, (radius, radius, radius)).within(ovary), liquid)

    def front(self, x: float) -> float:
        """Where the skin of the front is beside the groin, mm."""
        y = np.linspace(40.0, 180.0, 281)
        return float(y[np.argmax(self.body.distance(np.full_like(y, x), y, -60.0) > 0)])

    def vessels(self) -> Iterator[Layer]:
        """Iliac and femoral vessels, some hardened, and small things beside them."""
        vary, contrast = self.vary, self.contrast
        arterial, venous = blood(contrast.arteries), blood(0.8 * contrast.veins)
        old = vary.between(0, 1)
        for s in (-1, 1):
            artery = smooth_line([(s * x, y, z) for x, y, z in _ARTERY], 9.0)
            vein = [(x - s * (9 if z < 40 else 2), y - (2 if z < 30 else 11), z) for x, y, z in artery]
            inner = smooth_line([(s * 30, -2, 104), (s * 42, -26, 76), (s * 50, -44, 54), (s * 56, -50, 36)], 9.0)
            deep = [(s * 70, 66, -28), (s * 86, 46, -56), (s * 92, 34, -100)]
            calibre = vary(4.6, 0.4)
            yield Layer(tube(vein, vary(6.4, 0.7)), venous)
            yield Layer(tube([(x - s * 3, y - 7, z) for x, y, z in inner], 5.0), venous)
            for line, radius in ((inner, 3.4), (deep, 2.8), (artery, calibre)):
                yield Layer(tube(line, radius + 0.9), MUSCLE)
                yield Layer(tube(line, radius), arterial)
            for point in artery[:: max(round(6 - 5 * old), 1)] if old > 0.5 else []:
                plaque = ellipsoid((point[0], point[1] - calibre, point[2]), (3.4, 1.6, vary(5, 2)))
                yield Layer(plaque, CORTICAL_BONE, 0.85)
            saphena = [
                (s * 60, 76, -14),
                *((s * x, self.front(s * x) - 6 - 0.4 * self.fat, z) for x, z in ((58, -34), (54, -112))),
            ]
            yield Layer(tube(saphena, 2.4), venous)
            yield from self.small_things(s, venous)

    def small_things(self, s: int, venous: Tissue) -> Iterator[Layer]:
        """Lymph nodes of a groin, and small veins around bladder and rectum."""
        vary = self.vary
        for _ in range(5):  # lymph nodes with fat in their middle
            spot = (s * vary(62, 9), vary(82, 4), vary(0, 22))
            size = vary(4.0, 1.0)
            node = ellipsoid(spot, (1.5 * size, size, 1.6 * size), angle=vary(0, 0.5))
            yield Layer(node, MUSCLE)
            yield Layer(node.grown(-0.6 * size), FAT, 0.8)
        for _ in range(26):  # small vessels beside rectum, bladder and muscles
            x, y, z = s * vary(34, 7), vary(-14, 22), vary(20, 40)
            turn = vary.between(0, 2 * math.pi)
            far = (x + 9 * math.cos(turn), y + 9 * math.sin(turn), z + vary(0, 8))
            yield Layer(capsule((x, y, z), far, vary(1.2, 0.3), 0.8), venous, 0.7)
