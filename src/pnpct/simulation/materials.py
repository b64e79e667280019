"""What tissues, filters and detectors are made of, and how they attenuate."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import xraydb
from numpy.typing import NDArray


@dataclass(frozen=True)
class Material:
    """A mixture of elements.

    Args:
        density: Mass per volume, g/cm³, > 0.
        mass_fractions: Fraction of the mass of each element, by symbol; they sum to 1 within 1 %.

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
    "brain": _mixture(1.040, H=0.107, C=0.145, N=0.022, O=0.712, Na=0.002, P=0.004, S=0.002, Cl=0.003, K=0.003),
    "brain grey matter": _mixture(
        1.038, H=0.107, C=0.095, N=0.018, O=0.767, Na=0.002, P=0.003, S=0.002, Cl=0.003, K=0.003
    ),
    "brain white matter": _mixture(
        1.0345, H=0.106, C=0.194, N=0.025, O=0.661, Na=0.002, P=0.004, S=0.002, Cl=0.003, K=0.003
    ),
    "cerebrospinal fluid": _mixture(1.004, H=0.111, O=0.880, Na=0.005, Cl=0.004),
    "breast": _mixture(1.020, H=0.106, C=0.332, N=0.030, O=0.527, Na=0.001, P=0.001, S=0.002, Cl=0.001),
    "cartilage": _mixture(1.100, H=0.096, C=0.099, N=0.022, O=0.744, Na=0.005, P=0.022, S=0.009, Cl=0.003),
    "heart": _mixture(1.050, H=0.104, C=0.139, N=0.029, O=0.718, Na=0.001, P=0.002, S=0.002, Cl=0.002, K=0.003),
    "kidney": _mixture(
        1.050, H=0.103, C=0.132, N=0.030, O=0.724, Na=0.002, P=0.002, S=0.002, Cl=0.002, K=0.002, Ca=0.001
    ),
    "liver": _mixture(1.060, H=0.102, C=0.139, N=0.030, O=0.716, Na=0.002, P=0.003, S=0.003, Cl=0.002, K=0.003),
    "pancreas": _mixture(1.040, H=0.106, C=0.169, N=0.022, O=0.694, Na=0.002, P=0.002, S=0.001, Cl=0.002, K=0.002),
    "red marrow": _mixture(1.030, H=0.105, C=0.414, N=0.034, O=0.439, P=0.001, S=0.002, Cl=0.002, K=0.002, Fe=0.001),
    "skin": _mixture(1.090, H=0.100, C=0.204, N=0.042, O=0.645, Na=0.002, P=0.001, S=0.002, Cl=0.003, K=0.001),
    "spleen": _mixture(1.060, H=0.103, C=0.113, N=0.032, O=0.741, Na=0.001, P=0.003, S=0.002, Cl=0.002, K=0.003),
    "yellow marrow": _mixture(0.980, H=0.115, C=0.644, N=0.007, O=0.231, Na=0.001, S=0.001, Cl=0.001),
    "cortical bone": _mixture(
        1.920, H=0.034, C=0.155, N=0.042, O=0.435, Na=0.001, Mg=0.002, P=0.103, S=0.003, Ca=0.225
    ),
    "vertebra": _mixture(
        1.420, H=0.063, C=0.261, N=0.039, O=0.436, Na=0.001, Mg=0.001, P=0.061, S=0.003, Cl=0.001, K=0.001, Ca=0.133
    ),
    "aluminium": _mixture(2.699, Al=1.0),
    "titanium": _mixture(4.506, Ti=1.0),
    "carbon": _mixture(1.800, C=1.0),
    "scintillator": _mixture(5.950, O=0.177377, Y=0.440259, Eu=0.033695, Gd=0.348670),
    "cadmium telluride": _mixture(5.850, Cd=0.468355, Te=0.531645),
}
"""Tissues of adults of ICRU Reports 44 (1989; as NIST lists them, where it does) and 46 (1992), the lung inflated,
the vertebra a whole one (C4) without its cartilage, the blood with 10 mg/ml of iodine. Grey and white matter and
cerebrospinal fluid have the elements of Woodard and White, Br. J. Radiol. 59 (1986) 1209, and densities within the
usual 1.03 to 1.05 and 1.00 to 1.01 g/cm³ at which CT numbers are those of patients: 38, 29 and 7 HU at 70 keV. Then
the flat filter; and what detectors are made of, the scintillator as CatSim's "Lumex"."""


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
    at = tuple(np.ravel(energies).tolist())
    per_mass = sum(share * _mass_attenuation(element, at) for element, share in of.mass_fractions.items())
    # 1/cm to 1/mm.
    return np.asarray(of.density * per_mass / 10, dtype=np.float64).reshape(np.shape(energies))


@lru_cache(maxsize=256)
def _mass_attenuation(element: str, energies: tuple[float, ...]) -> NDArray[np.float64]:
    """Look up μ/ρ of an element in cm²/g; all materials share few elements, and the look-up is slow."""
    return np.asarray(xraydb.mu_elam(element, np.array(energies) * 1000), dtype=np.float64)
