"""The skull under the brain, with ears, throat and neck."""

from collections.abc import Iterator

import numpy as np

from pnpct.simulation.anatomy.folds import random_folds
from pnpct.simulation.anatomy.painted_body import Layer, bone
from pnpct.simulation.anatomy.shapes import Array, Point, Shape, capsule, ellipsoid, loft, tube, union
from pnpct.simulation.anatomy.tissues import AIR, CORTICAL_BONE, FAT, SPONGY_BONE, Tissue
from pnpct.simulation.anatomy.variation import Variation

SIDES = (-1, 1)
SOFT = Tissue({"muscle": 1.0}, {"adipose": 1.0}, share=0.06, texture={0.9: 0.05, 2.5: 0.07})
"""Muscle of the head, which has less fat in it than that of the trunk."""
MUCOSA = Tissue({"muscle": 0.8, "cerebrospinal fluid": 0.2})
FLUID = Tissue({"cerebrospinal fluid": 1.0})
BLOOD = Tissue({"blood": 0.87, "cerebrospinal fluid": 0.13})
"""Blood of a patient, without contrast medium: 50 HU, less than ICRU's."""

_GLAND = Tissue({"muscle": 1.0}, {"adipose": 1.0}, share=0.35, texture={0.9: 0.15, 2.5: 0.15})
_LABYRINTH = Tissue({"cortical bone": 1.0})  # the densest bone there is
_MASTOID = Tissue({"cortical bone": 0.7, "muscle": 0.3})
# Muscles of the left side: middle, half axes and the angle by which they are turned, rad.
_NECK: tuple[tuple[Point, Point, float], ...] = (
    ((9, 3, 0), (7, 5, 14), 0.0),
    ((30, -22, -6), (14, 8, 12), 0.2),
    ((44, -54, -4), (22, 9, 20), 0.7),
    ((26, -48, -4), (22, 11, 17), -0.2),
    ((16, -68, -2), (15, 13, 22), -0.1),
    ((61, -34, -8), (6, 18, 26), 0.3),
)


def petrous_ridges() -> Shape:
    """Return the two ridges that stand between the middle and the posterior fossa."""
    return union(*(capsule((s * 15, 4, 34), (s * 60, -24, 36), 4.5, 10.0) for s in SIDES))


class SkullBase:
    """The base of the skull of one patient.

    Args:
        vary: Generator of the variation.
        cavity: Inside of the skull.
    """

    def __init__(self, vary: Variation, cavity: Shape) -> None:
        self.vary, self.cavity = vary, cavity
        self.air_cells = random_folds(vary.generator, vary(8.5, 0.5))

    def layers(self) -> Iterator[Layer]:
        """Return neck and throat, the bones, and the ears in them."""
        yield from self.neck()
        yield from self.middle()
        for s in SIDES:
            yield from self.petrous(s)
            yield from self.ear(s)

    def neck(self) -> Iterator[Layer]:
        """Muscles with seams of fat, salivary glands, and the large vessels to and from the brain."""
        yield Layer(loft([(-14, 0, -52, 58, 30), (0, 0, -54, 52, 26), (9, 0, -60, 40, 18)]), SOFT)
        yield Layer(loft([(-10, 0, 17, 17, 12), (14, 0, 18, 17, 12), (24, 0, 20, 13, 9)]), SOFT)
        for s in SIDES:
            size = self.vary(1.0, 0.06)
            for (x, y, z), (a, b, c), angle in _NECK:
                muscle = ellipsoid((s * x, y, z), (size * a, size * b, c), angle=s * angle)
                yield Layer(muscle.grown(1.0), FAT, opacity=0.9)
                yield Layer(muscle, SOFT)
            yield Layer(ellipsoid((s * 60, -2, -2), (8, 16, 20), angle=s * 0.2), _GLAND)
            yield Layer(capsule((s * 25, 4, -5), (s * 25, 4, 25), 2.6), BLOOD)
            yield Layer(capsule((s * 30, -6, -5), (s * 30, -8, 22), self.vary(4.3, 0.8)), BLOOD)

    def middle(self) -> Iterator[Layer]:
        """The body of the sphenoid, its wings, the clivus and the condyles on which the head rests."""
        yield from bone(ellipsoid((0, 17, 33), (20, 22, 14), power=2.5), 1.5)
        yield from bone(ellipsoid((0, 22, 25), (34, 9, 5)), 1.3)
        yield from bone(loft([(-3, 0, 0, 11, 5), (10, 0, 4, 14, 7), (30, 0, 13, 18, 9), (44, 0, 21, 14, 7)]), 1.5)
        for s in SIDES:
            yield from bone(ellipsoid((s * 19, -15, 3), (7, 12, 7), angle=s * 0.4), 1.3)
            yield from bone(tube([(s * 8, 29, 49), (s * 26, 36, 51), (s * 48, 38, 54)], (3.0, 2.2, 2.6)), 1.1)
            yield Layer(capsule((s * 12, 28, 48), (s * 11, 19, 49), 2.4, 1.6), CORTICAL_BONE)

    def petrous(self, s: int) -> Iterator[Layer]:
        """Return the petrous bone, dense around the inner ear, and the mastoid with its cells of air."""
        yield Layer(capsule((s * 15, 5, 33), (s * 60, -24, 33), 7.0, 12.0), CORTICAL_BONE)
        yield Layer(capsule((s * 13, 6, 33), (s * 22, 1, 32), 4.0, 4.5), SPONGY_BONE)
        yield Layer(ellipsoid((s * 34, -7, 35), (11, 8, 8), angle=-s * 0.55), _LABYRINTH)
        tip, root = ellipsoid((s * 55, -28, 14), (13, 18, 22)), ellipsoid((s * 54, -24, 33), (12, 14, 11))
        mastoid = union(tip, root, smoothing=5.0)
        yield Layer(mastoid, CORTICAL_BONE)
        towards_the_ear = capsule((s * 40, -4, 28), (s * 54, -18, 32), 5.0, 8.0)
        spongy = union(mastoid, towards_the_ear, smoothing=4.0).grown(-1.8).without(self.cavity.grown(1.6))
        wall = self.vary(1.5, 1.0)

        def cells(x: Array, y: Array, z: float) -> Array:
            distance: Array = np.maximum(spongy.distance(x, y, z) + wall, 0.55 - self.air_cells.distance(x, y, z))
            return distance

        yield Layer(spongy, _MASTOID)
        yield Layer(Shape(cells, spongy.low, spongy.high), AIR, opacity=0.95)

    def ear(self, s: int) -> Iterator[Layer]:
        """Return the ear canal, the middle ear with an ossicle, the labyrinth and the canal of its nerves."""
        yield Layer(capsule((s * 56, -8, 28), (s * 69, -10, 28), 4.8), MUCOSA)
        yield Layer(tube([(s * 52, -6, 28), (s * 64, -9, 29), (s * 84, -13, 28)], 3.4), AIR)
        yield Layer(ellipsoid((s * 47, -4, 31), (3.5, 6, 8), angle=-s * 0.5), AIR)
        yield Layer(capsule((s * 47, -4, 31), (s * 46, -3, 35), 0.9), CORTICAL_BONE)
        cochlea, vestibule = ellipsoid((s * 35, -3, 32), (3, 3.5, 2.5)), ellipsoid((s * 38.5, -8, 34), (2.5, 2.5, 3))
        canal = ellipsoid((s * 41, -12, 36), (4.3, 4.3, 4.3))
        ring = canal.without(canal.grown(-1.0)).between(34.6, 35.8)
        for space in (cochlea, vestibule, ring, tube([(s * 20, -8, 35), (s * 33, -7, 34)], 2.4)):
            yield Layer(space, FLUID, opacity=0.85)
