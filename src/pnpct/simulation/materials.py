"""What tissues, filters and detectors are made of, and how they attenuate."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import xraydb
from numpy.typing import NDArray


@dataclass(frozen=True)
class Material:
    """A mixture of elements.

    Args:
        density: Mass per volume, g/cm³, > 0.
        mass_fractions: Share of each element in the mass, by symbol; they sum to 1 within 1 %.

    Raises:
        ValueError: If the density is not positive or the fractions do not sum to 1.
    """

    density: float
    mass_fractions: Mapping[str, float]

    def __post_init__(self) -> None:
        if not self.density > 0:
            raise ValueError(f"The density of a material must be positive, in g/cm³, got {self.density}.")
        total = sum(self.mass_fractions.values())
        if abs(total - 1) > 0.01:
            raise ValueError(f"The mass fractions of a material must sum to 1, got {total:.4f}.")


def _mixture(density: float, **mass_fractions: float) -> Material:
    return Material(density, mass_fractions)


def _with_iodine(material: Material, mg_per_ml: float) -> Material:
    iodine = mg_per_ml / 1000
    density = material.density + iodine
    diluted = {element: share * material.density / density for element, share in material.mass_fractions.items()}
    return Material(density, {**diluted, "I": iodine / density})


_BLOOD = _mixture(1.060, H=0.102, C=0.110, N=0.033, O=0.745, Na=0.001, P=0.001, S=0.002, Cl=0.003, K=0.002, Fe=0.001)

MATERIALS: dict[str, Material] = {
    "air": _mixture(0.001205, C=0.000124, N=0.755268, O=0.231781, Ar=0.012827),
    "water": _mixture(1.0, H=0.111898, O=0.888102),
    "adipose": _mixture(0.950, H=0.114, C=0.598, N=0.007, O=0.278, Na=0.001, S=0.001, Cl=0.001),
    "muscle": _mixture(1.050, H=0.102, C=0.143, N=0.034, O=0.710, Na=0.001, P=0.002, S=0.003, Cl=0.001, K=0.004),
    "lung": _mixture(0.260, H=0.103, C=0.105, N=0.031, O=0.749, Na=0.002, P=0.002, S=0.003, Cl=0.003, K=0.002),
    "blood": _BLOOD,
    "iodinated blood": _with_iodine(_BLOOD, 10.0),
    "cortical bone": _mixture(
        1.920, H=0.034, C=0.155, N=0.042, O=0.435, Na=0.001, Mg=0.002, P=0.103, S=0.003, Ca=0.225
    ),
    "aluminium": _mixture(2.699, Al=1.0),
    "tungsten": _mixture(19.25, W=1.0),
    "gadolinium oxysulfide": _mixture(7.34, Gd=0.8308, O=0.0845, S=0.0847),
}
"""Tissues of ICRU Report 44 (1989) as NIST lists them, the lung inflated, the blood with 10 mg/ml of iodine;
the flat filter; and the scintillator Gd₂O₂S."""


def attenuation(material: str, energies: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the linear attenuation coefficient μ(E) of a material, coherent scatter included.

    Args:
        material: One of `MATERIALS`.
        energies: Photon energies, keV, from 1 to 1000.

    Returns:
        μ at each energy, 1/mm.

    Raises:
        ValueError: If no material has this name, or an energy is outside the tables.

    References:
        Elam, Ravel and Sieber, Radiat. Phys. Chem. 63 (2002) 121, through xraydb.

    Example:
        >>> attenuation("water", np.array([60.0])).round(4)
        array([0.0206])
    """
    if material not in MATERIALS:
        raise ValueError(f'There is no material "{material}"; there are {", ".join(MATERIALS)}.')
    if not (np.all(np.isfinite(energies)) and np.all(energies >= 1) and np.all(energies <= 1000)):
        raise ValueError("Attenuation is tabulated from 1 to 1000 keV; are the energies in keV?")
    of = MATERIALS[material]
    per_mass = sum(share * xraydb.mu_elam(element, energies * 1000) for element, share in of.mass_fractions.items())
    # 1/cm to 1/mm.
    return np.asarray(of.density * per_mass / 10, dtype=np.float64)
