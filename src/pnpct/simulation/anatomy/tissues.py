"""What organs are painted with: mixtures of materials that vary from place to place."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from pnpct.simulation.anatomy.texture import Texture

Fraction: TypeAlias = float | NDArray[np.floating]
"""Volume fraction of a material: one number, or one per pixel."""


@dataclass(frozen=True)
class Tissue:
    """A base with an admixture whose share varies: (1 − s) · base + s · admixture.

    Args:
        base: Volume fractions of the base by material; they sum to 1.
        admixture: Volume fractions of what is mixed in; they sum to 1.
        share: Mean of s, 0 to 1.
        texture: Standard deviation of s for each correlation length in mm; s stays within 0 and 1.
        gravity: Growth of s per mm towards the front, as in the lung of a patient who lies on his back.

    Example:
        >>> muscle = Tissue({"muscle": 1.0}, {"adipose": 1.0}, share=0.04, texture={2.5: 0.12})
    """

    base: Mapping[str, float]
    admixture: Mapping[str, float] = field(default_factory=dict)
    share: float = 0.0
    texture: Mapping[float, float] = field(default_factory=dict)
    gravity: float = 0.0

    @property
    def materials(self) -> tuple[str, ...]:
        """All materials that occur in it."""
        return tuple(dict.fromkeys((*self.base, *self.admixture)))

    def fractions(self, texture: Texture, y: NDArray[np.floating], window: tuple[slice, slice]) -> dict[str, Fraction]:
        """Return the volume fraction of each material in a window of the slice.

        Args:
            texture: Fields of the slice.
            y: Position of each of its pixels, mm.
            window: Rows and columns that are wanted.
        """
        if not (self.texture or self.gravity):
            share: Fraction = self.share
        else:
            local = self.share + self.gravity * y[window]
            for length, deviation in self.texture.items():
                local = local + np.float32(deviation) * texture.field(length)[window]
            share = np.clip(local, 0.0, 1.0)
        return {
            material: (1 - share) * self.base.get(material, 0.0) + share * self.admixture.get(material, 0.0)
            for material in self.materials
        }


FAT = Tissue({"adipose": 1.0}, {"muscle": 1.0}, share=0.04, texture={0.9: 0.03, 2.5: 0.03})
MUSCLE = Tissue({"muscle": 1.0}, {"adipose": 1.0}, share=0.04, texture={0.9: 0.07, 2.5: 0.12, 12.0: 0.05})
SKIN = Tissue({"muscle": 0.85, "adipose": 0.15})
AIR = Tissue({"air": 1.0})
CORTICAL_BONE = Tissue({"cortical bone": 0.8, "adipose": 0.2})
SPONGY_BONE = Tissue(
    {"adipose": 0.5, "muscle": 0.5}, {"cortical bone": 1.0}, share=0.11, texture={0.9: 0.025, 2.5: 0.015}
)
CARTILAGE = Tissue({"muscle": 0.94, "cortical bone": 0.06})


def blood(iodine: float) -> Tissue:
    """Return blood with contrast medium: `iodine` parts of it, 0 to 1, have 10 mg/ml of iodine."""
    return Tissue({"blood": 1.0}, {"iodinated blood": 1.0}, share=iodine, texture={0.9: 0.012, 2.5: 0.012})


def perfused(base: str, iodine: float, *, fat: float = 0.0, grain: float = 0.012) -> Tissue:
    """Return an organ of one material in which contrast medium has arrived.

    Args:
        base: Material of the organ.
        iodine: Fraction of blood with 10 mg/ml of iodine, 0 to 1.
        fat: Fraction of fat in the rest, 0 to 1.
        grain: Standard deviation of the share of iodine at each of 0.9 and 2.5 mm.
    """
    mixture = {base: 1 - fat, "adipose": fat} if fat else {base: 1.0}
    return Tissue(mixture, {"iodinated blood": 1.0}, share=iodine, texture={0.9: grain, 2.5: grain})
