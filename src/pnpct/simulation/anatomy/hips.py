"""Bones and muscles of the pelvis: sacrum, ilium, ischium, pubis, femur, and what moves them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from pnpct.simulation.anatomy.lumbar import lumbar_vertebra
from pnpct.simulation.anatomy.painted_body import Layer, bone
from pnpct.simulation.anatomy.room import streaks
from pnpct.simulation.anatomy.sections import outline, sheet
from pnpct.simulation.anatomy.shapes import Point, Shape, capsule, ellipsoid, loft, tube, union
from pnpct.simulation.anatomy.tissues import CARTILAGE, CORTICAL_BONE, FAT, MUSCLE, Tissue
from pnpct.simulation.anatomy.variation import Variation

Stations: TypeAlias = Sequence[tuple[float, Sequence[Point]]]

HEAD: Point = (88.0, 8.0, 0.0)
"""Middle of the left femur's head, mm."""

TITANIUM = Tissue({"titanium": 1.0})
POLYETHYLENE = Tissue({"adipose": 0.9, "water": 0.1})
YELLOW_MARROW = Tissue({"yellow marrow": 0.97, "cortical bone": 0.03})

# Left side; x, y and half the thickness along each sheet, at heights in mm.
# fmt: off
_ILIUM: Stations = (
    (28.0, [(72, -26, 10), (78, -10, 10), (85, 10, 11), (94, 28, 9)]),
    (40.0, [(68, -36, 9), (75, -14, 9), (85, 10, 8), (99, 34, 7.5)]),
    (58.0, [(54, -66, 10), (66, -42, 8), (85, 2, 5), (109, 39, 6.5)]),
    (80.0, [(53, -78, 10), (68, -50, 7), (96, -4, 4), (120, 42, 6)]),
    (106.0, [(52, -78, 8), (72, -54, 6), (106, -14, 4.5), (125, 27, 6)]),
    (132.0, [(54, -72, 5), (80, -54, 5), (110, -22, 5), (122, 2, 4)]),
)
_ISCHIUM: Stations = (
    (-78.0, [(52, -40, 2), (55, -41, 3), (58, -42, 2)]),
    (-64.0, [(56, -45, 8), (60, -47, 9), (65, -48, 7)]),
    (-45.0, [(62, -40, 9), (67, -45, 11), (73, -46, 8)]),
    (-22.0, [(60, -18, 6), (66, -30, 9), (76, -38, 7)]),
    (4.0, [(58, -10, 5), (64, -23, 8), (82, -31, 7)]),
    (30.0, [(66, -14, 6), (70, -24, 8), (80, -28, 7)]),
)
_MUSCLES: Mapping[str, Stations] = {
    "gluteus maximus": (
        (-112.0, [(76, -58, 4), (96, -54, 9), (114, -42, 4)]), (-80.0, [(48, -78, 10), (84, -68, 17), (118, -44, 9)]),
        (-40.0, [(30, -92, 12), (76, -82, 23), (122, -46, 12)]), (0.0, [(20, -102, 12), (70, -92, 24), (122, -50, 10)]),
        (40.0, [(27, -106, 11), (66, -100, 20), (108, -70, 10)]), (80.0, [(40, -102, 9), (66, -98, 14), (96, -80, 8)]),
        (118.0, [(48, -94, 4), (60, -92, 6), (76, -84, 3)]),
    ),
    "gluteus medius": (
        (-14.0, [(128, -34, 3), (146, -16, 6), (142, 6, 3)]), (12.0, [(108, -50, 5), (131, -26, 12), (132, 12, 10)]),
        (45.0, [(88, -62, 7), (116, -34, 17), (132, 16, 12)]), (80.0, [(74, -72, 8), (109, -36, 16), (134, 18, 11)]),
        (126.0, [(82, -66, 6), (115, -36, 10), (134, 0, 6)]),
    ),
    "gluteus minimus": (
        (-8.0, [(116, 16, 2), (124, 16, 3), (128, 12, 2)]), (12.0, [(106, -20, 4), (116, 8, 7), (114, 27, 5)]),
        (40.0, [(88, -34, 4), (100, -4, 8), (113, 26, 5)]), (76.0, [(92, -28, 3), (108, -4, 4), (124, 28, 3)]),
    ),
    "iliacus": (
        (-55.0, [(102, 4, 5), (106, -2, 6), (106, -8, 4)]), (-12.0, [(82, 44, 9), (92, 47, 11), (99, 43, 7)]),
        (20.0, [(82, 44, 10), (92, 47, 11), (100, 48, 6)]), (50.0, [(73, -10, 6), (84, 20, 12), (98, 42, 7)]),
        (80.0, [(63, -32, 5), (83, 4, 11), (106, 38, 6)]), (122.0, [(72, -40, 3), (96, -10, 6), (112, 12, 3)]),
    ),
    "obturator internus": (
        (-52.0, [(44, 12, 3), (47, -10, 5), (52, -26, 4)]), (-25.0, [(50, 22, 5), (52, -8, 9), (56, -28, 6)]),
        (5.0, [(52, 14, 4), (52, -10, 8), (58, -34, 5)]), (32.0, [(58, 2, 2), (58, -16, 4), (62, -30, 3)]),
    ),
    "piriformis": (
        (10.0, [(82, -56, 2), (96, -48, 4), (108, -40, 3)]), (35.0, [(38, -74, 6), (70, -66, 8), (94, -52, 5)]),
        (58.0, [(36, -62, 4), (52, -66, 6), (62, -68, 3)]),
    ),
    "sartorius": (
        (-112.0, [(76, 64, 7), (86, 68, 8)]), (-40.0, [(96, 70, 6), (108, 71, 6)]),
        (20.0, [(110, 66, 5), (120, 62, 6)]), (74.0, [(116, 52, 4), (121, 48, 4)]),
    ),
    "tensor fasciae latae": (
        (-112.0, [(144, 32, 4), (154, 12, 4)]), (-40.0, [(138, 46, 8), (150, 26, 9)]),
        (20.0, [(132, 47, 7), (141, 35, 10)]), (76.0, [(128, 46, 3), (132, 38, 4)]),
    ),
    "rectus femoris": (
        (-112.0, [(102, 62, 13), (122, 58, 15)]), (-50.0, [(108, 58, 12), (124, 52, 13)]),
        (0.0, [(110, 52, 9), (120, 46, 10)]), (36.0, [(103, 42, 4), (108, 41, 4)]),
    ),
    "vastus": (
        (-112.0, [(94, 30, 14), (116, 34, 15), (142, 10, 22), (128, -26, 15)]),
        (-60.0, [(108, 30, 7), (124, 32, 11), (146, 6, 16), (134, -28, 10)]),
        (-24.0, [(124, 26, 3), (134, 14, 4), (143, -2, 4), (140, -18, 3)]),
    ),
    "pectineus": (
        (-80.0, [(62, 32, 8), (78, 24, 9), (90, 14, 7)]), (-40.0, [(42, 46, 10), (66, 36, 13), (86, 18, 7)]),
        (-6.0, [(48, 57, 6), (62, 53, 8), (72, 46, 5)]),
    ),
    "adductors": (
        (-112.0, [(40, 44, 18), (62, 10, 28), (80, -22, 20)]), (-75.0, [(26, 40, 15), (44, 16, 21), (66, -16, 18)]),
        (-42.0, [(20, 46, 6), (30, 36, 7), (38, 24, 5)]),
    ),
    "gracilis": ((-112.0, [(22, 44, 5), (22, 16, 6)]), (-62.0, [(16, 42, 4), (18, 26, 5)])),
    "obturator externus": (
        (-62.0, [(44, 12, 7), (64, 0, 10), (88, -14, 7)]), (-40.0, [(38, 28, 8), (60, 10, 12), (92, -18, 8)]),
        (-20.0, [(50, 30, 4), (60, 22, 6), (74, 12, 4)]),
    ),
    "quadratus femoris": (
        (-66.0, [(78, -34, 6), (92, -30, 7), (108, -24, 5)]), (-34.0, [(84, -38, 7), (98, -32, 8), (114, -26, 6)]),
    ),
    "hamstrings": (
        (-112.0, [(66, -50, 15), (86, -48, 16), (106, -38, 11)]), (-78.0, [(62, -54, 10), (76, -52, 13), (92, -46, 9)]),
        (-56.0, [(68, -56, 2), (74, -54, 3), (80, -50, 2)]),
    ),
    "oblique": (
        (60.0, [(70, 74, 2), (96, 64, 3), (114, 54, 3)]), (84.0, [(64, 80, 4), (96, 69, 6), (122, 50, 5)]),
        (132.0, [(66, 82, 6), (110, 62, 9), (134, 16, 8)]),
    ),
    "rectus": (
        (-24.0, [(4, 62, 3), (10, 63, 3), (16, 60, 3)]), (10.0, [(6, 78, 4), (18, 78, 6), (34, 72, 3)]),
        (60.0, [(7, 87, 4), (26, 87, 6), (50, 80, 3)]), (132.0, [(8, 91, 4), (34, 90, 6), (62, 83, 3)]),
    ),
    "levator": (
        (-50.0, [(10, 2, 2), (13, -30, 3), (4, -48, 3)]), (-20.0, [(20, 8, 1.5), (21, -32, 2), (7, -60, 2)]),
        (8.0, [(42, 2, 1.2), (36, -42, 1.5), (12, -70, 1.5)]),
    ),
}

# Right half of the sacrum's slices, from the middle in front around to the middle behind.
_SACRUM = (
    (-12.0, [(0, -81), (2, -81), (4, -82), (6, -84), (5, -86), (3, -87), (1, -88), (0, -88)]),
    (8.0, [(0, -80), (8, -80), (19, -82), (20, -87), (15, -92), (8, -95), (3, -97), (0, -97)]),
    (30.0, [(0, -67), (16, -68), (32, -70), (35, -78), (27, -88), (14, -94), (5, -99), (0, -100)]),
    (55.0, [(0, -43), (20, -45), (45, -50), (51, -62), (40, -76), (18, -84), (6, -93), (0, -95)]),
    (80.0, [(0, -22), (22, -24), (54, -36), (64, -52), (50, -68), (22, -74), (8, -84), (0, -87)]),
    (100.0, [(0, -7), (22, -10), (40, -26), (62, -38), (63, -52), (44, -62), (12, -70), (0, -72)]),
    (106.0, [(0, -9), (20, -11), (30, -20), (34, -30), (32, -42), (24, -48), (10, -46), (0, -46)]),
)
# fmt: on

_OUTER = ("gluteus maximus", "gluteus medius", "vastus", "tensor fasciae latae", "rectus femoris", "oblique", "rectus")


@dataclass(frozen=True)
class Hip:
    """One side of the pelvis with the upper end of the thigh.

    Args:
        side: 1 for the patient's left, at growing x, or −1.
        skin: What everything must stay in.
        vary: Generator of the variation.
        muscle: What muscles are made of.
        marrow: Inside of the bones, but for the shaft of the femur.
        bulk: Thickness of the muscles over the usual.
        metal: Whether the joint has been replaced.
    """

    side: int
    skin: Shape
    vary: Variation
    muscle: Tissue
    marrow: Tissue
    bulk: float = 1.0
    metal: bool = False

    def layers(self) -> Iterator[Layer]:
        """Return muscles, then bones."""
        yield from self.muscles()
        yield from self.pelvic_bone()
        yield from self.joint() if self.metal else self.femur()

    def _mirrored(self, x: float, y: float, z: float) -> Point:
        return (self.side * x, y, z)

    def _sheet(self, stations: Stations, scale: float = 1.0) -> Shape:
        mirrored = ((z, [(self.side * x, y, scale * r) for x, y, r in line]) for z, line in stations)
        return sheet(*mirrored, smoothing=5.0)

    def muscles(self) -> Iterator[Layer]:
        """Return all muscles, with septa of fat in the large ones."""
        psoas = (
            (-20, 80, 44, 7, 7),
            (10, 73, 45, 10, 10),
            (40, 65, 32, 13, 15),
            (80, 54, 8, 16, 19),
            (132, 46, -14, 21, 24),
        )
        shapes = {name: self._sheet(stations, self.bulk * self.vary(1.0, 0.05)) for name, stations in _MUSCLES.items()}
        shapes["psoas"] = loft([(z, self.side * x, y, self.bulk * a, self.bulk * b) for z, x, y, a, b in psoas])
        for name, shape in shapes.items():
            if name in _OUTER:
                shape = shape.within(self.skin)
            yield Layer(shape.grown(1.1), FAT)
            yield Layer(shape, self.muscle)
            if name in ("gluteus maximus", "gluteus medius", "adductors", "vastus"):
                yield from streaks(shape, 28 if name == "gluteus maximus" else 10, self.vary)

    def pelvic_bone(self) -> Iterator[Layer]:
        """Return ilium, ischium and pubis, one bone; the socket is open to the side."""
        at, (x, y, z) = self._mirrored, HEAD
        ramus = tube([at(70, 26, 10), at(44, 46, -8), at(14, 53, -26)], (10.0, 7.0, 8.0), smoothing=4.0)
        body = capsule(at(10, 53, -26), at(9, 44, -50), 7.5, 6.5)
        lower = tube([at(9, 42, -52), at(32, 8, -64), at(54, -34, -66)], (6.0, 5.0, 6.5), smoothing=3.0)
        cup = ellipsoid(at(x, y, z), (32.5, 32.5, 32.5)).between(-23.0, 40.0)
        open_side = ellipsoid(at(x + 46, y + 2, z - 10), (45.0, 70.0, 40.0))
        whole = union(
            self._sheet(_ILIUM), self._sheet(_ISCHIUM), cup.without(open_side), ramus, body, lower, smoothing=4.0
        )
        inner = ellipsoid(at(x, y, z), (26.8, 26.8, 26.8)).between(-23.0, 40.0)
        yield from bone(whole, 1.5, marrow=self.marrow)
        yield Layer(cup.without(open_side).within(inner.grown(1.8)), CORTICAL_BONE)
        yield Layer(inner, CARTILAGE)

    def femur(self) -> Iterator[Layer]:
        """Return head, neck, trochanters and shaft, with a thick wall and fatty marrow."""
        at, (x, y, z) = self._mirrored, HEAD
        knob = ellipsoid(at(x, y, z), (24.0, 24.0, 24.0))
        neck = capsule(at(x + 6, y - 2, z - 4), at(118, -5, -30), 15.5, 16.0)
        hook = ellipsoid(at(127, -12, -20), (13.0, 20.0, 24.0), power=2.4)
        small = ellipsoid(at(107, -17, -56), (9.0, 10.0, 13.0))
        line = [at(120, -5, -36), at(116, 0, -70), at(113, 4, -130)]
        whole = union(knob, neck, hook, small, tube(line, (18.0, 15.0, 14.0), smoothing=4.0), smoothing=6.0)
        core = union(knob.grown(-1.2), neck.grown(-2.2), hook.grown(-1.6), tube(line, (13.5, 9.0, 7.0)), smoothing=5.0)
        yield Layer(whole, CORTICAL_BONE)
        yield Layer(core, self.marrow)
        yield Layer(tube(line, (9.0, 8.5, 7.0), smoothing=3.0).between(-130.0, -44.0), YELLOW_MARROW)
        yield Layer(ellipsoid(at(122, -9, -24), (9.0, 13.0, 16.0)), YELLOW_MARROW, 0.6)

    def joint(self) -> Iterator[Layer]:
        """Return an artificial joint: cup, lining, ball, and a stem in what is left of the femur."""
        at, (x, y, z) = self._mirrored, HEAD
        natural = list(self.femur())
        for layer in natural:
            yield Layer(layer.shape.without(ellipsoid(at(x, y, z), (30.0, 30.0, 30.0))), layer.tissue, layer.opacity)
        cup = ellipsoid(at(x, y, z), (27.5, 27.5, 27.5))
        mouth = ellipsoid(at(x + 40, y, z - 30), (46.0, 70.0, 46.0))
        yield Layer(cup.without(mouth), TITANIUM)
        yield Layer(cup.grown(-3.5), POLYETHYLENE)
        yield Layer(ellipsoid(at(x, y, z), (16.0, 16.0, 16.0)), TITANIUM)
        stem = [at(x, y, z), at(112, -2, -20), at(119, -4, -40), at(115, 2, -90), at(113, 4, -130)]
        yield Layer(tube(stem, (6.5, 7.0, 9.0, 6.5, 5.5), smoothing=4.0), TITANIUM)


def sacrum(muscle: Tissue, marrow: Tissue) -> Iterator[Layer]:
    """Return the sacrum with its canal and openings, coccyx, the last lumbar vertebra and the muscle behind them.

    Args:
        muscle: What muscles are made of.
        marrow: Inside of the bones.
    """
    whole = outline(*((z, [*half, *((-x, y) for x, y in half[-2:0:-1])]) for z, half in _SACRUM))
    for side in (-1, 1):
        back = sheet(
            (20.0, [(side * 8, -100, 2), (side * 18, -98, 2)]),
            (80.0, [(side * 10, -86, 7), (side * 36, -86, 9)]),
            (106.0, [(side * 12, -76, 11), (side * 42, -78, 14)]),
            (132.0, [(side * 13, -76, 13), (side * 46, -76, 17)]),
        )
        yield Layer(back, muscle)
    yield Layer(whole.grown(1.6), CARTILAGE)
    yield from bone(whole, 1.3, marrow=marrow)
    yield Layer(
        tube([(0, -56, 112), (0, -62, 92), (0, -76, 62), (0, -90, 28)], (9.0, 8.0, 5.0, 2.5), smoothing=4.0), FAT
    )
    for x, y, z in ((22, -44, 84), (19, -58, 62), (17, -70, 42), (14, -80, 24)):
        for side in (-1, 1):
            yield Layer(capsule((side * x, y + 14, z - 3), (side * x, y - 16, z + 3), 4.2, 3.6), FAT)
            yield Layer(ellipsoid((side * x, y, z), (2.2, 2.2, 6.0)), MUSCLE)
    yield from bone(tube([(0, -84, -10), (0, -77, -26), (0, -66, -38)], (6.0, 5.0, 3.0)), 1.0, marrow=marrow)
    yield from lumbar_vertebra((0.0, -26.0, 124.0), 1.05, 15.5, marrow)
