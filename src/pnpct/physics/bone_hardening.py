"""What bone adds to the hardening of a beam, where the correction knows water only."""

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

LARGEST = (10.0, 4.0)
"""Line integrals of everything and of bone beyond which corrections grow no further: 80 mm of compact bone."""


@dataclass(frozen=True, eq=False)
class BoneHardening:
    """What line integrals lack behind bone, after the correction for water.

    With p the line integral that the correction for water gives, and q the part of bone in it, at the effective energy,
    they lack

        q (c₀ + c₁ p + c₂ q + c₃ p² + c₄ p q + c₅ q²).

    q comes from a first image: bone is compact bone mixed with water.

    Args:
        coefficients: c₀ to c₅; one row per bin, or one row for all.
        compact: Attenuation of compact bone relative to water, at the effective energy, > 1.

    Raises:
        ValueError: If a coefficient is not finite, or a number out of range.

    References:
        Joseph and Spital, J. Comput. Assist. Tomogr. 2 (1978) 100.
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
            of_bone: q, ≥ 0.
        """
        p, q = self._within(line_integrals, of_bone)
        c = self.coefficients.to(p).unbind(-1)
        return q * (c[0] + p * (c[1] + p * c[3]) + q * (c[2] + p * c[4] + q * c[5]))

    def slope(self, line_integrals: Rays, of_bone: Rays) -> Rays:
        """Return the derivative of `lacking` by p, by which the noise of a line integral grows too."""
        p, q = self._within(line_integrals, of_bone)
        c = self.coefficients.to(p).unbind(-1)
        return q * (c[1] + 2 * p * c[3] + q * c[4]) * (p == line_integrals)

    def in_image(self, image: Image, seen: Image) -> Image:
        """Return what bone contributes to each pixel, relative to water.

        Args:
            image: Attenuation relative to water.
            seen: The same with less noise, by which bone is found.
        """
        low, high = BONE
        share = ((seen - low) / (high - low)).clamp(0, 1)
        mixed = (image - 1).clamp(min=0) * self.compact / (self.compact - 1)
        return share * torch.minimum(mixed, image.clamp(min=0))

    def _within(self, line_integrals: Rays, of_bone: Rays) -> tuple[Rays, Rays]:
        return line_integrals.clamp(0.0, LARGEST[0]), of_bone.clamp(0.0, LARGEST[1])
