"""Units: HU against attenuation relative to water, and constants with their source."""

from jaxtyping import Float
from torch import Tensor

MU_WATER_70_KEV = 0.019258704781532
"""Attenuation of water at 70 keV, 1/mm (NIST XCOM through CatSim's tables; xraylib has 0.019288)."""


def to_hu(image: Float[Tensor, "..."]) -> Float[Tensor, "..."]:
    """Turn attenuation relative to water into Hounsfield units: HU = 1000 (image − 1)."""
    return 1000.0 * (image - 1.0)


def from_hu(image_hu: Float[Tensor, "..."]) -> Float[Tensor, "..."]:
    """Turn Hounsfield units into attenuation relative to water: image = 1 + HU / 1000."""
    return 1.0 + image_hu / 1000.0
