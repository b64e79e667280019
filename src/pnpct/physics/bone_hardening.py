"""What tissues add to the hardening of a beam, where the correction knows water only.

At the energies of CT every tissue attenuates as a mixture of water and compact bone does: marrow and bone, tissue
with contrast medium nearly so, and fat as water from which some bone is missing.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from pnpct.arrays import Image, Rays
from pnpct.geometry.short_repr import short_repr

TERMS = 6
"""Coefficients of the polynomial of second order in two variables."""

BONE = (1.2, 1.4)
"""From where to where pixels begin to count as bone, relative to water: 200 to 400 HU."""

SOFT = (0.75, 0.85)
"""From where to where pixels begin to count as soft tissue."""

FAT, WATER_IN_FAT = -0.0325, 1.01
"""Compact bone, by volume, and water in the mixture that attenuates as fat does, 40 to 110 keV."""

LEAN = 1.02
"""From here on soft tissue has no fat."""

ENHANCED = (1.055, 1.075)
"""From where to where soft tissue begins to count as water and bone: 55 to 75 HU, more than that of organs without
contrast medium. For the same HU, iodine hardens a beam up to a quarter more than bone does."""

LARGEST = (10.0, 4.0)
"""Line integrals of everything and of bone beyond which corrections grow no further: 80 mm of compact bone."""

LEAST = -1.0
"""The same of bone that is missing: 600 mm of fat."""


@dataclass(frozen=True, eq=False)
class BoneHardening:
    """What line integrals lack behind bone and other tissues, after the correction for water.

    With p the line integral that the correction for water gives, and q the part of bone in it, at the effective energy,
    they lack

        q (c₀ + c₁ p + c₂ q + c₃ p² + c₄ p q + c₅ q²).

    q comes from a first image, whose tissues are compact bone mixed with water; behind fat it is negative.

    Args:
        coefficients: c₀ to c₅; one row per bin, or one row for all.
        compact: Attenuation of compact bone relative to water, at the effective energy, > 1.

    Raises:
        ValueError: If a coefficient is not finite, or a number out of range.

    References:
        Joseph and Spital, J. Comput. Assist. Tomogr. 2 (1978) 100; Alvarez and Macovski, Phys. Med. Biol. 21 (1976)
        733: all tissues of two materials.
    """

    coefficients: Float[Tensor, "bins terms"]
    compact: float

    __repr__ = short_repr

    def __post_init__(self) -> None:
        if self.coefficients.ndim != 2 or self.coefficients.shape[0] < 1 or self.coefficients.shape[1] != TERMS:
            raise ValueError(
                f"A correction for bone needs {TERMS} coefficients per bin, or for all, got the shape "
                f"{tuple(self.coefficients.shape)}."
            )
        if not bool(self.coefficients.isfinite().all()):
            raise ValueError("A correction for bone needs finite coefficients; some are NaN or infinite.")
        if not 1 < self.compact < 10:
            raise ValueError(f"Compact bone attenuates 1 to 10 times as much as water, got {self.compact}.")

    def lacking(self, line_integrals: Rays, of_bone: Rays) -> Rays:
        """Return what line integrals lack, dimensionless.

        Args:
            line_integrals: p, corrected for water.
            of_bone: q; negative behind fat.
        """
        p, q = self._within(line_integrals, of_bone)
        c = self.coefficients.to(p).unbind(-1)
        return q * (c[0] + p * (c[1] + p * c[3]) + q * (c[2] + p * c[4] + q * c[5]))

    def slope(self, line_integrals: Rays, of_bone: Rays) -> Rays:
        """Return the derivative of `lacking` by p, by which the noise of a line integral grows too."""
        p, q = self._within(line_integrals, of_bone)
        c = self.coefficients.to(p).unbind(-1)
        return q * (c[1] + 2 * p * c[3] + q * c[4]) * (p == line_integrals)

    def in_image(self, image: Image, seen: Image, around: Image) -> Image:
        """Return what bone contributes to each pixel, relative to water; of fat it is less than nothing.

        Args:
            image: Attenuation relative to water.
            seen: The same with less noise, by which bone and soft tissue are found.
            around: Mean of the soft tissue around each pixel.
        """
        of_bone = torch.minimum(self._mixed(image), image.clamp(min=0))
        return _rising(seen, BONE) * of_bone + soft_tissue(seen) * self._in_soft_tissue(around)

    def _in_soft_tissue(self, image: Image) -> Image:
        fat = WATER_IN_FAT + FAT * self.compact
        of_fat = FAT * self.compact * (1 - _rising(image, (fat, LEAN)))
        return of_fat + _rising(image, ENHANCED) * self._mixed(image)

    def _mixed(self, image: Image) -> Image:
        """What bone contributes to a mixture of water and compact bone."""
        return (image - 1).clamp(min=0) * self.compact / (self.compact - 1)

    def _within(self, line_integrals: Rays, of_bone: Rays) -> tuple[Rays, Rays]:
        return line_integrals.clamp(0.0, LARGEST[0]), of_bone.clamp(LEAST, LARGEST[1])


def soft_tissue(seen: Image) -> Image:
    """Return which share of each pixel counts as soft tissue, 0 to 1: neither air, nor lung, nor bone."""
    return _rising(seen, SOFT) * (1 - _rising(seen, BONE))


def _rising(image: Image, between: tuple[float, float]) -> Image:
    """From 0 up to the lower number to 1 from the higher one on."""
    low, high = between
    return ((image - low) / (high - low)).clamp(0, 1)
