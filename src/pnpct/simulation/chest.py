"""A procedural axial slice through the chest, at the level of the heart."""

import math

import numpy as np

from pnpct.geometry import ImageGrid
from pnpct.simulation.canvas import Canvas, Mixture
from pnpct.simulation.phantom import Phantom
from pnpct.simulation.shapes import Array, Shape, capsule, ellipse, union

MATERIALS_OF_THE_CHEST = (
    "air",
    "water",
    "adipose",
    "muscle",
    "lung",
    "blood",
    "iodinated blood",
    "cortical bone",
)


def chest_phantom(generator: np.random.Generator, *, grid: ImageGrid | None = None) -> Phantom:
    """Draw an adult's chest: lungs and their vessels, heart, aorta, ribs, spine, muscle, fat and skin.

    Sizes, positions, the amount of fat, the iodine in the blood and all textures vary with the generator; one
    seed gives one patient on every grid. No arms, no table, no disease.

    Args:
        generator: Source of the variation; a given state gives the same bytes.
        grid: Where the pixels are; 1024 × 1024 over 450 mm if None.

    Returns:
        The phantom, about 370 × 250 mm, in supine position: front at +y, the patient's left at +x.

    Example:
        >>> phantom = chest_phantom(np.random.default_rng(1), grid=ImageGrid(64, 64, spacing=7.0))
        >>> phantom.fractions.shape
        torch.Size([8, 64, 64])
    """
    return _Chest(generator, grid or ImageGrid(1024, 1024, spacing=450 / 1024)).draw()


class _Chest:
    """One patient; positions in mm from the middle of the chest."""

    def __init__(self, generator: np.random.Generator, grid: ImageGrid) -> None:
        self.random = generator
        self.canvas = Canvas(MATERIALS_OF_THE_CHEST, grid, generator, bending={40.0: 2.5, 9.0: 0.6})
        size = self.vary(1.0, 0.03)
        depth = self.vary(size, 0.02)
        self.body = union(
            ellipse((0.0, -24.0), (180 * size, 100 * depth), power=2.2),
            ellipse((0.0, 14.0), (150 * size, 112 * depth), power=2.2),
            smoothing=30.0,
        )
        self.cage = union(
            ellipse((0.0, -26.0), (134 * size, 84 * depth), power=2.3),
            ellipse((0.0, 10.0), (116 * size, 90 * depth), power=2.2),
            smoothing=25.0,
        )
        self.heart_center = (self.vary(30, 4), self.vary(24, 4))
        self.iodine = float(generator.uniform(0.25, 0.6))
        fine, middle, coarse = (self.canvas.noise(length) for length in (0.9, 2.5, 12.0))
        streaks = np.clip(0.04 + 0.03 * fine + 0.03 * middle, 0.0, 0.5)
        marbling = np.clip(0.04 + 0.07 * fine + 0.12 * middle + 0.05 * coarse, 0.0, 0.8)
        # Heavier towards the back, where a supine patient's lung is squeezed.
        air = np.clip(0.45 + 0.05 * fine + 0.05 * middle + 0.03 * coarse + 0.0009 * self.canvas.y, 0.05, 0.8)
        spongy = np.clip(0.11 + 0.025 * fine + 0.015 * middle, 0.02, 0.6)
        self.fat: Mixture = {"adipose": 1 - streaks, "muscle": streaks}
        self.muscle: Mixture = {"muscle": 1 - marbling, "adipose": marbling}
        self.lung: Mixture = {"lung": 1 - air, "air": air}
        self.marrow: Mixture = {
            "cortical bone": spongy,
            "adipose": (1 - spongy) / 2,
            "muscle": (1 - spongy) / 2,
        }
        self.cortex: Mixture = {"cortical bone": 0.8, "adipose": 0.2}
        self.grain = 0.012 * fine + 0.012 * middle

    def vary(self, mean: float, deviation: float) -> float:
        """Draw a normal number, not farther from its mean than two standard deviations."""
        return mean + deviation * float(np.clip(self.random.standard_normal(), -2, 2))

    def draw(self) -> Phantom:
        self.wall()
        self.ribs()
        self.lungs()
        self.mediastinum()
        self.heart()
        self.spine()
        return self.canvas.finish()

    def blood(self, iodine: float) -> Mixture:
        share = np.clip(iodine + self.grain, 0.0, 1.0)
        return {"iodinated blood": share, "blood": 1 - share}

    def bone(self, shape: Shape, wall: float) -> None:
        self.canvas.paint(shape, self.cortex)
        self.canvas.paint(shape.grown(-wall), self.marrow)

    def wall(self) -> None:
        """Skin, fat and the muscles around the ribs, with fat between their layers."""
        thin, thick = self.vary(7, 1.5), self.vary(17, 4)
        body, cage, canvas = self.body, self.cage, self.canvas

        def muscles(x: Array, y: Array) -> Array:
            side = np.abs(x) / np.maximum(np.hypot(x, y), 1e-6)
            return body.distance(x, y) + thin + (thick - thin) * side**2

        def septum(x: Array, y: Array) -> Array:
            # Fat between latissimus and serratus, where the noise leaves room for it.
            return np.abs(cage.distance(x, y) - 17 - 0.06 * y) - gaps

        gaps = np.clip(0.8 + 1.3 * canvas.noise(14.0), -1.0, 4.0)
        canvas.paint(body, {"muscle": 0.85, "adipose": 0.15})
        canvas.paint(body.grown(-1.8), self.fat)
        layer = Shape(muscles, body.center, body.reach)
        canvas.paint(layer, self.muscle)
        canvas.paint(layer.without(Shape(lambda x, y: -septum(x, y), body.center, body.reach)), self.fat)
        for side in (-1, 1):
            x = side * self.vary(148, 4)
            y = self.vary(-42, 6)
            scapula = capsule((x, y + 14), (x - side * self.vary(13, 3), y - 13), 4.2, 3.0)
            canvas.paint(scapula.grown(7.0), self.muscle)
            self.bone(scapula, 1.5)

    def ribs(self) -> None:
        """Slices of the ribs: long where a rib runs along the slice, with muscle between them."""
        canvas, cage = self.canvas, self.cage
        canvas.paint(cage.grown(7.0), self.muscle)
        for side in (0.0, math.pi):
            for angle in (-1.15, -0.68, -0.1, 0.42, 0.86):
                middle = self.vary(angle, 0.06)
                length = self.vary(48, 10)
                tilt = self.vary(0.06, 0.02)
                self.bone(self.rib(side, middle, length / 2, tilt), 1.0)
        sternum = capsule((self.vary(-13, 1.5), 110), (self.vary(13, 1.5), 110), 6.0)
        for side in (-1, 1):
            cartilage = capsule((side * 22, 109), (side * 52, 102), 5.0)
            canvas.paint(cartilage, {"muscle": 0.94, "cortical bone": 0.06})
        self.bone(sternum, 1.4)

    def rib(self, side: float, middle: float, half_length: float, tilt: float) -> Shape:
        cage, radius = self.cage, 120.0

        def distance(x: Array, y: Array) -> Array:
            along = np.arctan2(y + 12, x if side == 0.0 else -x) - middle
            along = (along + math.pi) % (2 * math.pi) - math.pi
            beyond = np.maximum(np.abs(along * radius) - half_length, 0.0)
            thickness = 3.2 - 1.2 * np.minimum((along * radius / half_length) ** 2, 1.0)
            return np.hypot(beyond, cage.distance(x, y) - 3.5 - tilt * along * radius) - thickness

        x = radius * math.cos(middle) * (1 if side == 0.0 else -1)
        return Shape(distance, (x, radius * math.sin(middle) - 12), half_length + 45)

    def lungs(self) -> None:
        """The inside of the cage, with vessels that run from the roots of the lungs outwards."""
        canvas = self.canvas
        inside = self.cage.grown(-1.0)
        canvas.paint(inside, self.lung)
        for side, root in ((-1, (-24.0, -20.0)), (1, (44.0, -24.0))):
            for trunk in np.linspace(-1.5, 1.5, 13):
                turn, rise = self.vary(trunk, 0.15), self.vary(0.0, 0.5)
                heading = (
                    side * math.cos(turn) * math.cos(rise),
                    math.sin(turn) * math.cos(rise),
                    math.sin(rise),
                )
                start = (root[0], root[1], self.vary(0.0, 8.0))
                self.vessel(np.array(start), np.array(heading), self.vary(3.0, 0.6), inside)

    def vessel(self, start: Array, heading: Array, radius: float, inside: Shape) -> None:
        """A branch and all that springs from it, in three dimensions; a slice of 2 mm keeps its part."""
        if radius < 0.33:
            return
        end = start + heading * (5.0 + 5.0 * radius) * self.vary(1.0, 0.25)
        if abs(end[2]) > 15 or float(inside.distance(end[:1], end[1:2])[0]) > -3.0:
            return
        slope = (end[2] - start[2]) or 1e-9
        first, last = sorted(np.clip(((-1 - start[2]) / slope, (1 - start[2]) / slope), 0.0, 1.0))
        if last > first:
            (x0, y0, _), (x1, y1, _) = start + first * (end - start), start + last * (end - start)
            thin = min(radius / 1.2, 1.0)
            self.canvas.paint(capsule((x0, y0), (x1, y1), radius), self.blood(self.iodine), opacity=thin)
        for share in (0.84, 0.68):
            aside = heading + 0.3 / share * self.random.standard_normal(3)
            self.vessel(end, aside / np.linalg.norm(aside), radius * self.vary(share, 0.05), inside)

    def mediastinum(self) -> None:
        """Fat around the heart, the great vessels behind it, the gullet and the large airways."""
        canvas, (x, y) = self.canvas, self.heart_center
        around = union(
            ellipse((x, y), (70, 58), angle=-0.35),
            ellipse((8, -40), (24, 24)),
            ellipse((self.vary(14, 4), 84), (36, 17), angle=-0.15),
            ellipse((0, -72), (27, 25)),
            smoothing=16.0,
        )
        canvas.paint(around.within(self.cage), self.fat)
        for side, root in ((-1, (-22.0, -22.0)), (1, (44.0, -26.0))):
            for turn in (-0.6, -0.1, 0.5):
                length = self.vary(24, 5)
                end = (root[0] + side * length * math.cos(turn), root[1] + length * math.sin(turn))
                canvas.paint(capsule(root, end, self.vary(5.5, 0.7), 2.5), self.blood(self.iodine))
            bronchus = ellipse((root[0] + side * 7, root[1] - 13), (self.vary(4.5, 0.6), 4.0))
            canvas.paint(bronchus.grown(1.2), self.muscle)
            canvas.paint(bronchus, {"air": 1.0})
        aorta = ellipse((self.vary(27, 2), self.vary(-50, 2)), (self.vary(13, 1), 13))
        canvas.paint(aorta.grown(1.3), self.muscle)
        canvas.paint(aorta, self.blood(self.iodine))
        canvas.paint(ellipse((-9, -47), (4, 4)), self.blood(0.8 * self.iodine))
        gullet = ellipse((self.vary(8, 1.5), -41), (8, 5.5))
        canvas.paint(gullet, self.muscle)
        canvas.paint(ellipse(gullet.center, (self.vary(2.2, 0.6), 1.2)), {"air": 1.0})

    def heart(self) -> None:
        """Heart muscle and four chambers."""
        canvas, (x, y) = self.canvas, self.heart_center
        share = np.clip(0.62 * self.iodine + self.grain, 0.0, 1.0)
        perfused: Mixture = {"muscle": 1 - share, "iodinated blood": share}
        heart = union(ellipse((x, y), (62, 50), angle=-0.35), ellipse((x - 14, y - 38), (32, 16)), smoothing=8.0)
        canvas.paint(heart, perfused)
        chambers = (
            (ellipse((x + 22, y - 6), (29, 22), angle=-0.6), 1.0),
            (ellipse((x - 4, y + 26), (36, 15), angle=-0.35), 0.9),
            (ellipse((x - 37, y - 2), (17, 25), angle=0.1), 0.9),
            (ellipse((x - 14, y - 38), (28, 13), angle=-0.1), 1.0),
        )
        for chamber, enhancement in chambers:
            canvas.paint(chamber, self.blood(enhancement * self.iodine))

    def spine(self) -> None:
        """Vertebra, cord and the muscles along the back."""
        canvas, y = self.canvas, -71.0
        back = union(
            ellipse((-30, y - 42), (33, 15), angle=0.2),
            ellipse((30, y - 42), (33, 15), angle=-0.2),
            ellipse((0, y - 24), (26, 22)),
            smoothing=6.0,
        )
        canvas.paint(back.within(self.body.grown(-6.0)), self.muscle)
        body = ellipse((0, y), (self.vary(20, 1), self.vary(17, 1)), power=2.3)
        arch = [capsule((side * 13, y - 13), (side * 14, y - 26), 5.0) for side in (-1, 1)]
        arch += [capsule((side * 14, y - 26), (0, y - 37), 4.0) for side in (-1, 1)]
        arch += [capsule((side * 15, y - 24), (side * 36, y - 33), 5.0, 4.0) for side in (-1, 1)]
        vertebra = union(body, *arch, capsule((0, y - 36), (0, y - 44), 3.6, 3.0), smoothing=2.0)
        self.bone(vertebra, 1.5)
        canal = ellipse((0, y - 25), (9.5, 8.0))
        canvas.paint(canal, self.fat)
        canvas.paint(ellipse(canal.center, (7.0, 5.8)), {"water": 0.5, "muscle": 0.5})
