"""A procedural chest, from the diaphragm to the shoulders."""

import math
from collections.abc import Iterator

import numpy as np

from pnpct.simulation.anatomy.painted_body import Layer, PaintedBody, bone
from pnpct.simulation.anatomy.room import Room, tree
from pnpct.simulation.anatomy.shapes import Array, Shape, capsule, ellipsoid, loft, tube, union
from pnpct.simulation.anatomy.skeleton import Rib, spinal_canal, vertebra
from pnpct.simulation.anatomy.tissues import AIR, CORTICAL_BONE, FAT, MUSCLE, SKIN, Tissue, blood, perfused
from pnpct.simulation.anatomy.variation import Variation

LOWEST, HIGHEST = -110.0, 150.0


def chest_body(generator: np.random.Generator) -> PaintedBody:
    """Build an adult's chest: lungs with vessels and airways, heart, ribs, spine, shoulders, muscle, fat, skin.

    Sizes, positions, the amount of fat, the iodine in the blood and all textures vary with the generator; one
    seed gives one patient. The heart is at z = 0, the diaphragm near −70 mm, the shoulders above 100 mm. The
    arms are raised; no table, no disease.

    Args:
        generator: Generator of the variation; a given state gives the same patient.

    Returns:
        The body, about 370 × 250 mm, in supine position: front at +y, the patient's left at +x.

    Example:
        >>> from pnpct.geometry import ImageGrid
        >>> body = chest_body(np.random.default_rng(1))
        >>> body.slice(0.0, ImageGrid(64, 64, spacing=7.0)).grid.shape
        (64, 64)
    """
    patient = _Chest(generator)
    return PaintedBody(tuple(patient.layers()), LOWEST, HIGHEST, seed=patient.vary.seed())


class _Chest:
    """One patient; positions in mm from the middle of the chest."""

    def __init__(self, generator: np.random.Generator) -> None:
        self.vary = vary = Variation(generator)
        wide = vary(1.0, 0.03)
        deep = vary(wide, 0.02)

        def stack(*stations: tuple[float, float, float, float], power: float) -> Shape:
            return loft([(z, 0.0, y, a * wide, b * deep) for z, y, a, b in stations], power=power)

        self.body = union(
            stack((-140, -24, 168, 98), (0, -24, 180, 100), (80, -26, 188, 96), (150, -30, 212, 94), power=2.2),
            stack((-140, 14, 150, 112), (0, 14, 150, 112), (80, 6, 138, 96), (150, -8, 90, 70), power=2.2),
            smoothing=30.0,
        )
        self.cage = union(
            stack(
                (-140, -26, 138, 86),
                (0, -26, 134, 84),
                (60, -28, 122, 76),
                (105, -32, 88, 58),
                (145, -38, 40, 34),
                power=2.3,
            ),
            stack(
                (-140, 10, 120, 94),
                (0, 10, 116, 90),
                (60, 2, 104, 78),
                (105, -10, 70, 58),
                (145, -26, 34, 32),
                power=2.2,
            ),
            smoothing=25.0,
        )
        self.heart = (vary(30, 4), vary(24, 4), vary(-8, 5))
        self.iodine = vary.between(0.15, 0.6)
        # Heavier towards the back, where a supine patient's lung is squeezed.
        self.lung = Tissue(
            {"lung": 1.0},
            {"air": 1.0},
            share=vary(0.45, 0.05),
            texture={0.9: 0.05, 2.5: 0.05, 12.0: 0.03},
            gravity=0.0009,
        )

    def layers(self) -> Iterator[Layer]:
        yield from self.wall()
        yield from self.shoulders()
        yield from self.ribs()
        yield from self.lungs()
        yield from self.below_the_diaphragm()
        yield from self.mediastinum()
        yield from self.heart_and_great_vessels()
        yield from self.spine()

    def wall(self) -> Iterator[Layer]:
        """Skin, fat and the muscles around the ribs, with fat between their layers."""
        thin, thick = self.vary(7, 1.5), self.vary(17, 4)
        body, cage = self.body, self.cage

        def muscles(x: Array, y: Array, z: float) -> Array:
            side = np.abs(x) / np.maximum(np.hypot(x, y), 1e-6)
            return body.distance(x, y, z) + thin + (thick - thin) * side**2

        def septum(x: Array, y: Array, z: float) -> Array:
            # Fat between latissimus and serratus.
            return np.abs(cage.distance(x, y, z) - 17 - 0.06 * y) - 0.9

        yield Layer(body, SKIN)
        yield Layer(body.grown(-1.8), FAT)
        layer = Shape(muscles, body.low, body.high)
        yield Layer(layer, MUSCLE)
        yield Layer(Shape(septum, body.low, body.high).within(layer), FAT)

    def shoulders(self) -> Iterator[Layer]:
        """Scapulae behind the cage, collar bones and the heads of the arms at the top."""
        vary = self.vary
        for side in (-1, 1):
            tip = (side * vary(128, 4), vary(-74, 4), -45.0)
            angle = (side * vary(150, 4), vary(-38, 4), 95.0)
            inner = (side * vary(78, 4), vary(-92, 3), 85.0)
            blade = union(*(capsule(a, b, 4.5) for a, b in ((tip, angle), (tip, inner), (inner, angle))), smoothing=8.0)
            for share in (0.3, 0.55, 0.8):
                a, b = (tuple(np.array(tip) + share * (np.array(end) - tip)) for end in (angle, inner))
                blade = union(blade, capsule(a, b, 3.4), smoothing=3.0)
            yield Layer(blade.grown(8.0).within(self.body.grown(-5.0)), MUSCLE)
            yield from bone(blade.within(self.body.grown(-6.0)), 1.4)
            head = ellipsoid((side * vary(176, 3), vary(-24, 3), 122.0), (23, 23, 25))
            yield Layer(head.grown(16.0).within(self.body.grown(-4.0)), MUSCLE)
            yield from bone(head, 1.6)
            collar = tube(
                [(side * 22, 52, 112), (side * 70, 40, 122), (side * 120, 8, 130), (side * 152, -6, 130)], 6.0
            )
            yield from bone(collar, 1.6)

    def ribs(self) -> Iterator[Layer]:
        """Twelve pairs, the breastbone and the muscle between them."""
        vary = self.vary
        yield Layer(self.cage.grown(7.0), MUSCLE)
        for number in range(13):
            height = 135.0 - 23.0 * number
            for side in (-1, 1):
                drop = vary(62 if number > 2 else 42, 4)
                yield from Rib(self.cage, side, height + vary(4, 2), drop, last=vary(0.8, 0.06)).layers()
        plate = [(z, 0.0, self.front(z) + 1.0, wide, 5.5) for z, wide in ((-45, 10), (-10, 16), (50, 15), (95, 26))]
        yield from bone(loft(plate, power=2.6), 1.3)

    def front(self, z: float) -> float:
        """Position of the cage's front in the middle, mm."""
        y = np.linspace(0.0, 150.0, 301)
        return float(y[np.argmax(self.cage.distance(np.zeros_like(y), y, z) > 0)]) + 4.0

    def lungs(self) -> Iterator[Layer]:
        """The inside of the cage, with vessels and airways from the roots of the lungs outwards."""
        vary, inside = self.vary, self.cage.grown(-1.0).between(LOWEST, HIGHEST)
        yield Layer(inside, self.lung)
        room = Room(inside, spacing=5.0)
        for side, root in ((-1, (-26.0, -20.0, 20.0)), (1, (44.0, -24.0, 22.0))):
            for trunk in range(30):
                # Even on the half sphere away from the middle.
                rise = -1 + 2 * (trunk + 0.5) / 30
                turn = (trunk * 2.399963) % math.pi - math.pi / 2
                flat = math.sqrt(1 - rise**2)
                heading = (side * math.cos(turn) * flat, math.sin(turn) * flat, rise)
                start = (vary(root[0], 6.0), vary(root[1], 6.0), vary(root[2], 6.0))
                for piece, radius in tree(start, heading, vary(2.6, 0.5), room, vary, spread=0.6):
                    if trunk % 5 == 0 and radius > 1.1:
                        yield from self.airway_beside(piece, 0.8 * radius)
                    yield Layer(piece, blood(self.iodine), opacity=min(0.3 + 0.5 * radius, 1.0))

    def airway_beside(self, vessel: Shape, radius: float) -> Iterator[Layer]:
        """A branch of the airways that runs along an artery."""
        middle = [(low + high) / 2 for low, high in zip(vessel.low, vessel.high, strict=True)]
        half = [(high - low) / 2 - radius for low, high in zip(vessel.low, vessel.high, strict=True)]
        beside = 2.4 * radius
        start = (middle[0] - half[0], middle[1] + beside, middle[2] - half[2])
        end = (middle[0] + half[0], middle[1] + beside, middle[2] + half[2])
        airway = capsule(start, end, radius)
        yield Layer(airway.grown(0.9), MUSCLE, opacity=0.8)
        yield Layer(airway, AIR)

    def below_the_diaphragm(self) -> Iterator[Layer]:
        """The domes: liver on the right, spleen and a stomach with gas on the left, fat around them."""
        vary, inside = self.vary, self.cage.grown(-1.5)
        right = ellipsoid((vary(-62, 4), vary(2, 4), vary(-142, 6)), (84, 92, 78))
        left = ellipsoid((vary(66, 4), vary(-6, 4), vary(-148, 6)), (76, 84, 68))
        for dome in (right, left):
            yield Layer(dome.within(inside), MUSCLE)
        yield Layer(right.grown(-3.0).within(inside), perfused("muscle", vary(0.16, 0.05)))
        yield Layer(left.grown(-3.0).within(inside), FAT)
        stomach = ellipsoid((vary(50, 5), vary(30, 5), -128.0), (44, 34, 42)).within(left.grown(-5.0))
        yield Layer(stomach, MUSCLE)
        yield Layer(stomach.grown(-4.0), Tissue({"water": 0.93, "muscle": 0.07}))
        level = ellipsoid((50.0, 1000.0 + vary(34, 6), -128.0), (1000.0, 1000.0, 1000.0))
        yield Layer(stomach.grown(-4.0).within(level), AIR)
        spleen = ellipsoid((vary(104, 4), vary(-52, 4), -124.0), (24, 42, 38), angle=-0.5)
        yield Layer(spleen.within(left.grown(-4.0)), perfused("muscle", vary(0.24, 0.06)))

    def mediastinum(self) -> Iterator[Layer]:
        """Fat between the lungs, with the gullet, the windpipe and its two branches."""
        vary, (x, y, z) = self.vary, self.heart
        around = union(
            ellipsoid((x, y, z - 6), (72, 60, 62), angle=-0.35),
            loft(
                [
                    (-110, 10, -48, 26, 24),
                    (20, 8, -40, 24, 26),
                    (60, 2, -24, 34, 42),
                    (100, 0, -16, 34, 40),
                    (150, 0, -24, 34, 34),
                ]
            ),
            loft([(-70, vary(14, 4), 84, 36, 17), (20, 12, 84, 30, 17), (70, 2, 48, 26, 36), (150, 0, 0, 30, 40)]),
            loft([(-140, 0, -72, 27, 25), (60, 0, -72, 25, 25), (150, 0, -70, 25, 26)]),
            smoothing=16.0,
        )
        yield Layer(around.within(self.cage), FAT)
        carina = (vary(2, 2), -36.0, vary(52, 4))
        airways = [
            (tube([(0, -14, 152), (1, -24, 100), carina], 8.5), 1.3),
            (tube([carina, (-24, -36, 28), (-44, -38, 8)], (7.0, 6.0, 4.5)), 1.2),
            (tube([carina, (30, -38, 26), (56, -42, 6)], (6.5, 5.5, 4.0)), 1.2),
        ]
        for airway, wall in airways:
            yield Layer(airway.grown(wall), MUSCLE)
        for airway, _ in airways:
            yield Layer(airway, AIR)
        gullet = tube([(2, -42, 152), (6, -46, 60), (10, -42, 0), (18, -30, -60), (24, -10, -100)], 6.5)
        yield Layer(gullet, MUSCLE)
        yield Layer(gullet.grown(-5.0), AIR, opacity=0.8)

    def heart_and_great_vessels(self) -> Iterator[Layer]:
        """Heart muscle, four chambers, aorta, venae cavae and the arteries of the lungs."""
        vary, (x, y, z) = self.vary, self.heart
        filled = blood(self.iodine)
        arch = [(x - 16, y + 10, 10), (x - 24, y + 4, 46), (-6, 10, 72), (12, -18, 82), (vary(24, 2), -44, 70)]
        down = [(25, -52, 40), (vary(26, 2), -50, -10), (vary(14, 3), -46, -100)]
        aorta = tube([*arch, *down], vary(12.5, 0.8), smoothing=4.0)
        vessels = [
            tube([(-30, 14, 130), (-30, 4, 40), (-28, 0, 16)], 8.5, smoothing=3.0),
            tube([(-24, -6, -30), (-22, -8, -100)], 11.0),
            tube([(x - 2, y + 16, 14), (10, 0, 40), (-34, -18, 30)], (12.0, 11.0, 7.0), smoothing=3.0),
            tube([(10, 0, 40), (46, -24, 34), (60, -28, 22)], (10.0, 8.5, 6.0), smoothing=3.0),
            tube([(2, 8, 72), (-10, 8, 110), (-22, 2, 150)], 6.0),
            tube([(12, -14, 80), (22, -10, 150)], 4.5),
            tube([(14, -22, 82), (30, -26, 150)], 4.8),
            tube([(-9, -48, 60), (-9, -47, -100)], 4.0),
        ]
        for side, root in ((-1, (-22.0, -22.0, 8.0)), (1, (44.0, -26.0, 8.0))):
            for turn in (-0.6, -0.1, 0.5):
                length = vary(26, 5)
                end = (root[0] + side * length * math.cos(turn), root[1] + length * math.sin(turn), root[2] + 30 * turn)
                vessels.append(capsule(root, end, vary(5.5, 0.7), 2.5))
        muscle = perfused("muscle", 0.62 * self.iodine)
        yield Layer(
            union(
                ellipsoid((x, y, z - 8), (62, 50, 52), angle=-0.35),
                ellipsoid((x - 14, y - 38, z + 14), (32, 16, 28)),
                smoothing=8.0,
            ),
            muscle,
        )
        chambers = (
            (ellipsoid((x + 22, y - 6, z - 12), (29, 22, 34), angle=-0.6), 1.0),
            (ellipsoid((x - 4, y + 26, z - 14), (36, 15, 32), angle=-0.35), 0.9),
            (ellipsoid((x - 37, y - 2, z - 4), (17, 25, 28), angle=0.1), 0.9),
            (ellipsoid((x - 14, y - 38, z + 14), (28, 13, 24), angle=-0.1), 1.0),
        )
        for chamber, enhancement in chambers:
            yield Layer(chamber, blood(enhancement * self.iodine))
        for vessel in vessels:
            yield Layer(vessel, filled)
        yield Layer(aorta.grown(1.3), MUSCLE)
        yield Layer(aorta, filled)
        if vary.between(0, 1) < 0.4:  # a plaque in the wall, as in many patients
            yield Layer(ellipsoid((36, -46, vary(0, 30)), (1.6, 4.0, 6.0)), CORTICAL_BONE)

    def spine(self) -> Iterator[Layer]:
        """Vertebrae, cord and the muscles along the back."""
        y = -71.0
        back = union(
            loft([(-140, -30, y - 42, 35, 17), (150, -30, y - 40, 30, 14)]),
            loft([(-140, 30, y - 42, 35, 17), (150, 30, y - 40, 30, 14)]),
            loft([(-140, 0, y - 24, 26, 22), (150, 0, y - 24, 24, 22)]),
            smoothing=6.0,
        )
        yield Layer(back.within(self.body.grown(-6.0)), MUSCLE)
        for number in range(13):
            size = self.vary(1 - 0.02 * number, 0.01)
            yield from vertebra((0, y, -135.0 + 23.5 * number), 20 * size, 17 * size, 11.75)
        yield from spinal_canal(0.0, y, -140.0, 152.0)
