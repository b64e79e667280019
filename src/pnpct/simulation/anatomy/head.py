"""A procedural head, from the base of the skull to the vertex."""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from pnpct.simulation.anatomy.brain import Brain
from pnpct.simulation.anatomy.face import Face
from pnpct.simulation.anatomy.painted_body import Layer, PaintedBody
from pnpct.simulation.anatomy.shapes import Array, Point, Shape, capsule, ellipsoid, loft, union
from pnpct.simulation.anatomy.skull_base import SOFT, SkullBase, petrous_ridges
from pnpct.simulation.anatomy.tissues import CORTICAL_BONE, FAT, SKIN, Tissue
from pnpct.simulation.anatomy.variation import Variation

BENDING = {40.0: 1.2, 12.0: 0.35}
"""How far outlines are bent: less than those of a `PaintedBody` usually are, for the skull."""

_TOP = 140.0  # of the inside of the skull
_DIPLOE = Tissue({"adipose": 0.5, "muscle": 0.5}, {"cortical bone": 1.0}, share=0.36, texture={0.9: 0.06, 2.5: 0.08})
_SUTURE = Tissue({"muscle": 0.9, "cortical bone": 0.1})
# Skin below the skull's roof: heights, middle and half axes of the face and of the neck.
_FACE = (
    (-14, 0, 22, 66, 67),
    (0, 0, 24, 70, 66),
    (15, 0, 22, 74, 66),
    (38, 0, 20, 74, 66),
    (55, 0, 22, 73, 72),
    (66, 0, 22, 66, 64),
)
_NECK = (
    (-14, 0, -30, 66, 50),
    (0, 0, -30, 70, 55),
    (15, 0, -30, 75, 59),
    (38, 0, -30, 76, 60),
    (55, 0, -32, 73, 60),
    (66, 0, -32, 66, 54),
)


def head_body(generator: np.random.Generator) -> PaintedBody:
    """Build an adult's head: scalp, skull with its base and air cells, eyes, and a brain with a folded cortex.

    Sizes, age (which widens sulci and ventricles), thickness of the skull, air in sinuses and mastoids, folds
    and all textures vary with the generator; one seed gives one patient. z = 0 is at the foramen magnum, the
    eyes are near 38 mm, the third ventricle near 70 mm, the upper end is where the skull ends. No face of a
    person, no teeth, no headrest, no disease; no contrast medium.

    Args:
        generator: Generator of the variation; a given state gives the same patient.

    Returns:
        The body, about 155 mm wide and 200 mm long, in supine position: front at +y, the patient's left at +x.

    Example:
        >>> from pnpct.geometry import ImageGrid
        >>> body = head_body(np.random.default_rng(1))
        >>> body.slice(70.0, ImageGrid(64, 64, spacing=4.0)).grid.shape
        (64, 64)
    """
    patient = _Head(generator)
    layers = tuple(patient.posed(layer) for layer in patient.layers())
    highest = patient.size[2] * (_TOP + patient.thick)
    return PaintedBody(layers, 0.0, highest, seed=patient.vary.seed(), bending=BENDING)


class _Head:
    """One patient; positions in mm from the middle of the head and the foramen magnum, before it is scaled."""

    def __init__(self, generator: np.random.Generator) -> None:
        self.vary = vary = Variation(generator)
        large = vary(1.0, 0.025)
        self.size = (vary(large, 0.012), vary(large, 0.012), vary(large, 0.012))
        self.turn = vary(0.0, 0.025)
        self.thick, self.scalp = vary(6.0, 0.8), vary(6.3, 0.8)
        self.waves = [vary.between(0, 2 * math.pi) for _ in range(3)]
        self.cavity = _cavity(vary)
        around, face, neck = self.skull(0.0).grown(self.scalp), loft(_FACE, power=2.8), loft(_NECK, power=2.4)
        nose = [capsule((0, 82, 42), (0, 95, 8), 6.0, 11.0)]
        nose += [ellipsoid((s * 10, 88, 4), (8, 10, 9)) for s in (-1, 1)]
        lids = [ellipsoid((s * 32, 74, 38), (19, 10, 15)) for s in (-1, 1)]
        self.skin = _stacked(around, face, neck, *nose, *lids, smoothing=8.0)

    def posed(self, layer: Layer) -> Layer:
        """Scale a layer to the size of the patient and turn it as the head lies."""
        (a, b, c), cosine, sine, shape = self.size, math.cos(self.turn), math.sin(self.turn), layer.shape
        mean = (a + b) / 2

        def distance(x: Array, y: Array, z: float) -> Array:
            return mean * shape.distance((cosine * x + sine * y) / a, (cosine * y - sine * x) / b, z / c)

        corners = [(a * x, b * y) for x in (shape.low[0], shape.high[0]) for y in (shape.low[1], shape.high[1])]
        xs, ys = [cosine * x - sine * y for x, y in corners], [sine * x + cosine * y for x, y in corners]
        low, high = (min(xs), min(ys), c * shape.low[2]), (max(xs), max(ys), c * shape.high[2])
        return replace(layer, shape=Shape(distance, low, high))

    def layers(self) -> Iterator[Layer]:
        yield from self.soft_tissue()
        yield from self.vault()
        yield from SkullBase(self.vary, self.cavity).layers()
        yield from Face(self.vary, self.cavity).layers()
        yield from Brain(self.vary, self.cavity).layers()

    def thickness(self, x: Array, y: Array, z: float) -> Array:
        """Thickness of the skull, mm: thin at the temples and under the brain, thick at the back of the head."""
        temples = np.exp(-(((np.abs(x) - 66) / 14) ** 2) - ((z - 52) / 18) ** 2 - ((y - 5) / 35) ** 2)
        base = 0.45 / (1 + math.exp((z - 48) / 3))
        back = np.exp(-((x / 25) ** 2) - ((y + 85) / 20) ** 2 - ((z - 50) / 20) ** 2)
        first, second, third = self.waves
        waves = 0.1 * np.sin(x / 17 + first) * np.sin(y / 21 + z / 19 + second) + 0.08 * np.sin(y / 13 - z / 16 + third)
        thickness: Array = self.thick * ((1 - 0.5 * temples) * (1 - base) + 0.6 * back + waves)
        return thickness

    def skull(self, inset: float) -> Shape:
        """Return the skull with all that is in it, or what is this deep below its surface, mm."""
        cavity = self.cavity

        def distance(x: Array, y: Array, z: float) -> Array:
            return cavity.distance(x, y, z) - self.thickness(x, y, z) + inset

        reach = 1.8 * self.thick
        low, high = ((v - reach for v in cavity.low), (v + reach for v in cavity.high))
        return Shape(distance, _point(*low), _point(*high))

    def soft_tissue(self) -> Iterator[Layer]:
        """Ears, skin, fat, the sheet of muscle on the skull and the muscles of the temples."""
        for s in (-1, 1):
            ear = ellipsoid((s * 78.5, -22, 35), (3.2, 16, 26), angle=s * 0.45)
            yield Layer(ear.without(ellipsoid((s * 81.5, -20, 35), (2.6, 11, 19), angle=s * 0.45)), SKIN)
        yield Layer(self.skin, SKIN)
        yield Layer(self.skin.grown(-1.6), FAT)
        surface, under = self.skull(0.0), self.skin.grown(-3.0)
        sheet = surface.grown(1.0).between(58, 200)
        yield Layer(sheet, SOFT, opacity=0.7)

        def temples(x: Array, y: Array, z: float) -> Array:
            thick = 9.0 * (1 - ((y - 14) / 48) ** 2 - ((z - 36) / 52) ** 2)
            distance: Array = np.maximum(surface.distance(x, y, z) - thick, 20 - np.abs(x))
            return distance

        yield Layer(Shape(temples, (-95, -36, 10), (95, 64, 90)).within(under), SOFT)

    def vault(self) -> Iterator[Layer]:
        """Both tables of the skull, the diploe between them, and three sutures."""
        yield Layer(self.skull(0.0), CORTICAL_BONE)
        yield Layer(self.skull(self.vary(1.8, 0.2)).without(self.cavity.grown(self.vary(1.6, 0.15))), _DIPLOE)

        def sutures(x: Array, y: Array, z: float) -> Array:
            wiggle = np.sin(1.7 * x + 0.9 * y + 1.3 * z) + np.sin(0.8 * y - 1.1 * z)
            sagittal = np.maximum(np.abs(x + 0.8 * wiggle), max(112.0 - z, 0.0) + np.maximum(y - 32, 0))
            coronal = np.abs(y - 30 + 0.15 * (_TOP - z) + 0.8 * wiggle)
            lambdoid = np.maximum(np.abs(112 - z - 0.9 * np.abs(x) + wiggle), np.maximum(y + 40, 0))
            distance: Array = np.minimum(np.minimum(sagittal, coronal), lambdoid) - 0.55
            return distance

        skull = self.skull(0.0)
        yield Layer(Shape(sutures, skull.low, skull.high).within(skull.between(58, 200)), _SUTURE, opacity=0.6)


def _cavity(vary: Variation) -> Shape:
    """The inside of the skull: three pits and a vault; the orbits bulge into its floor from below."""

    def floor(x: Array, y: Array, z: float) -> Array:
        roofs = np.exp(-(((np.abs(x) - 31) / 16) ** 2) - ((y - 58) / 20) ** 2)
        return 46 + 11.5 * roofs - z

    vault = union(
        ellipsoid((0, 22, 82), (vary(59, 1), vary(62, 1), 55)),
        ellipsoid((0, -20, 84), (vary(67, 1), vary(67, 1), _TOP - 84)),
        smoothing=25.0,
    ).within(Shape(floor, (-100, -120, 45), (100, 120, 200)))
    middle = [ellipsoid((s * 38, 14, 50), (25, 33, 24), angle=s * 0.25) for s in (-1, 1)]
    behind = ellipsoid((0, -44, 40), (54, 39, 34))
    stem = [(-10, 0, -30, 17, 17), (10, 0, -20, 17, 17), (30, 0, -10, 21, 19), (50, 0, 4, 22, 22), (60, 0, 4, 22, 22)]
    return _stacked(vault, *middle, behind, loft(stem), smoothing=6.0).without(petrous_ridges())


def _stacked(*shapes: Shape, smoothing: float) -> Shape:
    """The union of solids, of which those far above or below a slice are left out to save time."""

    def distance(x: Array, y: Array, z: float) -> Array:
        near = [shape for shape in shapes if shape.low[2] - 20 < z < shape.high[2] + 20]
        return union(*near or shapes, smoothing=smoothing).distance(x, y, z)

    whole = union(*shapes, smoothing=smoothing)
    return Shape(distance, whole.low, whole.high)


def _point(x: float, y: float, z: float) -> Point:
    return (x, y, z)
