"""What is behind the abdomen: spine, muscles of the back, aorta and vena cava."""

import math
from collections.abc import Iterator
from dataclasses import replace

from pnpct.simulation.anatomy.bowel import smooth_line
from pnpct.simulation.anatomy.contrast import Contrast
from pnpct.simulation.anatomy.painted_body import Layer, bone
from pnpct.simulation.anatomy.room import streaks
from pnpct.simulation.anatomy.sections import outline, sheet
from pnpct.simulation.anatomy.shapes import Point, Shape, capsule, ellipsoid, loft, tube, union
from pnpct.simulation.anatomy.skeleton import spinal_canal
from pnpct.simulation.anatomy.tissues import CARTILAGE, CORTICAL_BONE, MUSCLE, SPONGY_BONE, Tissue, blood
from pnpct.simulation.anatomy.variation import Variation

BENDING = {40.0: 1.7, 9.0: 0.6}
"""How far outlines of abdomen and pelvis are bent: less than those of a `PaintedBody` usually are, for the skin."""

_DISC = Tissue({"muscle": 0.96, "cortical bone": 0.04}, {"water": 1.0}, share=0.2, texture={2.5: 0.1, 9.0: 0.12})


# Corners of a vertebra's body around its middle; and muscles of the left side at heights in mm: middle and half axes,
# points and half thickness, corners.
# fmt: off
_BODY = ((-24, 1), (-22, 12), (-13, 19), (0, 21), (13, 19), (22, 12), (24, 1), (21, -11), (12, -17), (0, -14.5),
         (-12, -17), (-21, -11))
_PSOAS = (
    (-112, 44, -37, 21, 26), (-60, 39, -40, 17, 23), (0, 33, -46, 12, 19), (40, 29, -50, 6, 11), (62, 27, -53, 2, 3),
)
_QUADRATUS = (
    (-112.0, [(54, -56, 8.0), (86, -64, 7.0)]), (0.0, [(48, -66, 6.0), (74, -75, 5.0)]),
    (56.0, [(46, -74, 2.5), (58, -78, 2.5)]),
)
_ERECTOR = (
    (-140.0, [(3, -76), (20, -68), (46, -68), (70, -76), (80, -90), (74, -106), (50, -116), (22, -119), (4, -114)]),
    (0.0, [(3, -74), (20, -66), (44, -68), (68, -78), (82, -92), (76, -105), (52, -114), (24, -117), (5, -112)]),
    (140.0, [(3, -74), (18, -70), (36, -74), (52, -82), (62, -93), (58, -103), (42, -109), (22, -112), (5, -108)]),
)
# fmt: on


def drawn_marrow(vary: Variation, share: float) -> Tissue:
    """Draw the inside of a patient's bones, with about this share of bone; the trabeculae blur in a slice."""
    return replace(SPONGY_BONE, share=vary(share, 0.02), texture={0.9: 0.014, 2.5: 0.016, 9.0: 0.012})


def lumbar_vertebra(center: Point, size: float, height: float, marrow: Tissue = SPONGY_BONE) -> Iterator[Layer]:
    """Return a vertebra of the lower back and the disc under it, without the canal.

    Args:
        center: Middle of its body, mm.
        size: Its width over 48 mm.
        height: Half the distance to the next vertebra, disc included, mm.
        marrow: What is inside.
    """
    x, y, z = center

    def at(dx: float, dy: float, thick: float) -> Point:
        return (x + size * dx, y + size * dy, size * thick)

    def ring(share: float) -> list[tuple[float, float]]:
        return [(x + share * size * dx, y + share * size * dy) for dx, dy in _BODY]

    top = 0.8 * height
    yield Layer(outline((z - 1.25 * height, ring(1.03)), (z, ring(1.03))), _DISC)
    yield from bone(
        outline((z - top, ring(1.02)), (z - 0.4 * top, ring(0.94)), (z + 0.4 * top, ring(0.94)), (z + top, ring(1.02))),
        1.0,
        marrow=marrow,
    )
    for s in (-1, 1):
        pedicle = [at(s * 15, -12, 4.5), at(s * 17, -27, 5.0)]
        lamina = [at(s * 17, -28, 4.5), at(s * 10, -38, 3.5), at(0, -44, 3.5)]
        wing = [at(s * 17, -28, 4.5), at(s * 29, -32, 3.2), at(s * 43, -37, 3.6)]
        yield from bone(sheet((z - 1, pedicle), (z + 0.7 * top, pedicle)), 1.0, marrow=marrow)
        yield from bone(sheet((z - 0.9 * top, lamina), (z + 0.45 * top, lamina)), 1.1, marrow=marrow)
        yield from bone(sheet((z - 4, wing), (z + 0.4 * top, wing)), 0.9, marrow=marrow)
        upper = capsule((x + s * 19, y - 32, z + 5), (x + s * 20, y - 34, z + 1.15 * height), 5.2)
        lower = capsule((x + s * 15, y - 39, z - 3), (x + s * 13, y - 42, z - 1.1 * height), 4.6)
        for facet in (lower, upper):
            yield Layer(facet.grown(0.7), CARTILAGE)
            yield from bone(facet, 2.0, marrow=marrow)
    spine = [at(0, -43, 3.0), at(0, -56, 2.6), at(0, -70, 3.6)]
    yield from bone(sheet((z - 1.1 * top, spine), (z + 0.2 * top, spine)), 1.0, marrow=marrow)


def back(vary: Variation, muscles: Shape) -> Iterator[Layer]:
    """Return spine, crests of the hips, crura of the diaphragm, psoas, quadratus lumborum, and the erectors.

    Args:
        vary: Generator of the variation.
        muscles: What all muscles together fill, up to the fat under the skin.
    """
    marrow, top = drawn_marrow(vary, 0.115), vary(-86, 4)
    for side in (-1, 1):
        yield from _beside_the_spine(side, vary, muscles)
        crest = [(side * 88, -72, 4.0), (side * 112, -52, 5.0), (side * 131, -24, 4.0)]
        rim = [(x, y, 0.8 * thick) for x, y, thick in crest]
        yield from bone(sheet((-140.0, crest), (top, rim)), 1.5, marrow=marrow)
        crus = sheet(
            (-30.0, [(side * 9 + 2, -20, 2.0), (side * 12 + 2, -24, 2.0)]),
            (45.0, [(side * 13 + 4, -8, 4.0), (side * 20 + 2, -28, 3.0)]),
            (112.0, [(side * 10 + 2, 2, 3.5), (side * 22 + 2, -36, 2.5)]),
        )
        yield Layer(crus, MUSCLE)
    for number in range(8):
        size = vary(1.0 - 0.015 * number, 0.01)
        yield from lumbar_vertebra((0.0, -38.0, -132.0 + 33.0 * number), size, 16.5, marrow)
    yield from spinal_canal(0.0, -38.0, -140.0, 140.0)


def _beside_the_spine(side: int, vary: Variation, muscles: Shape) -> Iterator[Layer]:
    bulk = vary(1.0, 0.08)
    psoas = loft([(z, side * (22 + bulk * (x - 22)), y, bulk * a, bulk * b) for z, x, y, a, b in _PSOAS])
    flank = sheet(*((z, [(side * x, y, thick) for x, y, thick in line]) for z, line in _QUADRATUS))
    erector = outline(*((z, [(side * x, y) for x, y in ring]) for z, ring in _ERECTOR)).within(muscles.grown(-2.0))
    for muscle, count in ((flank, 4), (psoas, 8), (erector, 80)):
        yield Layer(muscle, MUSCLE)
        yield from streaks(muscle, count, vary)


def great_vessels(vary: Variation, contrast: Contrast) -> tuple[list[Layer], list[Layer]]:
    """Return the branches of aorta, vena cava and portal vein; and aorta and vena cava, some with plaques.

    Args:
        vary: Generator of the variation.
        contrast: Iodine at the time of the scan.

    Returns:
        What organs may cover, and what covers organs.
    """
    x, y, r = vary(9, 2), vary(-6, 2), vary(9.5, 1.0)
    arterial, venous = blood(contrast.arteries), blood(contrast.veins)
    cava: list[Point] = [(-14, -8, -80), (-20, 0, -40), (-22, 4, 0), (-25, 0, 40), (-28, -10, 75), (-26, -10, 112)]
    half = vary(8.0, 0.8)  # two tubes side by side are an oval
    pair = [tube([(px + dx, py, pz) for px, py, pz in cava], half) for dx in (-3.5, 3.5)]
    lower = [tube([end, cava[0]], (8.0, 9.0)) for end in ((-32, -18, -112), (14, -16, -112))]
    aorta = tube([(4, -14, 112), (x - 1, y - 4, 60), (x, y, 0), (5, y + 2, -76)], (r + 1, r + 0.5, r, 0.85 * r))
    legs = [tube([(5, y + 2, -76), (s * 20 + 3, y - 6, -112)], (0.7 * r, 0.6 * r)) for s in (-1, 1)]
    whole = union(aorta, *legs, smoothing=3.0)
    trunks = [
        Layer(union(*lower, *pair, smoothing=3.0), venous),
        Layer(whole.grown(1.1), MUSCLE),
        Layer(whole, arterial),
    ]
    for _ in range(int(vary.between(-4, 12))):
        turn, z = vary.between(0, 2 * math.pi), vary.between(-75, 60)
        plaque = ellipsoid((x + r * math.cos(turn), y + r * math.sin(turn), z), (3.5, 3.5, vary.between(2, 8)))
        trunks.append(Layer(plaque.within(aorta.grown(1.4)).without(aorta.grown(-0.4)), CORTICAL_BONE))
    return list(_branches(vary, contrast, (x, y))), trunks


def _branches(vary: Variation, contrast: Contrast, aorta: tuple[float, float]) -> Iterator[Layer]:
    (x, y), lift = aorta, vary(0, 3)
    arterial, venous, portal = blood(contrast.arteries), blood(contrast.veins), blood(contrast.portal)
    for side, z, behind in ((-1, -6.0, -2.0), (1, 2.0, 6.0)):
        vein: list[Point] = [(-17 + 3 * side, 4, z), (side * 24, behind, z - 1), (side * 50, -12, z - 4)]
        yield Layer(tube(smooth_line(vein, 8.0), 4.2), venous)
        artery: list[Point] = [(x, y, z + 6), (side * 20, -8, z + 4), (side * 50, -14, z)]
        yield Layer(tube(smooth_line(artery, 8.0), 2.6), arterial)
    for dx, dy, radius, tissue in ((-13, 4, 5.5, portal), (0, 0, 3.6, arterial)):
        run = [(4 + dx, 32 + dy, 6), (2 + dx, 36 + dy, -25), (-8 + dx, 36 + dy, -72), (-22 + dx, 30 + dy, -105)]
        yield Layer(tube(run, [radius, radius, 0.7 * radius, 0.4 * radius], smoothing=2.0), tissue)
    for line, radius, tissue in (
        ([(x, y, 28), (7, 18, 20), (4, 32, 6)], 3.8, arterial),
        ([(x, y, 38), (8, 12, 42), (-4, 22, 43), (-20, 20, 42 + lift), (-38, 24, 44)], 2.6, arterial),
        ([(8, 12, 42), (20, 14, 44 + lift), (36, 6, 45), (60, 10, 48 - lift), (90, -8, 44)], 2.4, arterial),
        ([(-9, 36, 6), (-14, 34, 18), (-30, 26, 36), (-48, 16, 48)], vary(6.0, 0.5), portal),
    ):
        yield Layer(tube(smooth_line(line, 7.0), radius), tissue)
