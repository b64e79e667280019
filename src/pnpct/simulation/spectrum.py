"""The spectrum of a tungsten x-ray tube, from tables."""

import math
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from pnpct.geometry.short_repr import short_repr
from pnpct.simulation.materials import attenuation

Array: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Photons by energy.

    Args:
        energies: Mean energy of each bin, keV.
        photons: Photons in each bin at a distance of one metre, per mm² and mAs.
    """

    energies: Array
    photons: Array

    __repr__ = short_repr

    def behind(self, material: str, thickness: float) -> "Spectrum":
        """Return what a filter lets through: photons · exp(−μ(E) · thickness), scatter not counted.

        Args:
            material: One of `MATERIALS`.
            thickness: Length of the path in the filter, mm, ≥ 0.

        Raises:
            ValueError: If the material is unknown or the thickness is negative.
        """
        if not (math.isfinite(thickness) and thickness >= 0):
            raise ValueError(f"The thickness of a filter must be a length from 0 up, in mm, got {thickness}.")
        transmitted = np.exp(-attenuation(material, self.energies) * thickness)
        return Spectrum(self.energies, self.photons * transmitted)

    @property
    def mean_energy(self) -> float:
        """Mean over the photons, keV."""
        return float(np.average(self.energies, weights=self.photons))


def tube_spectrum(tube_voltage_kvp: float, *, bins: int | None = None) -> Spectrum:
    """Return the spectrum of a tungsten anode of 7 degrees behind the tube's own filtration.

    It comes from tables for 70, 80, … 140 kVp in steps of 1 keV, the ones that CatSim uses; between two of
    them it is their mixture.

    Args:
        tube_voltage_kvp: Peak tube voltage, 70 to 140 kVp.
        bins: Bins of even width that share the energies from 0 up, at least 8; None keeps the 1 keV of the
            tables. The energy of a bin is the mean over its photons, and bins without photons are left out.

    Returns:
        Photons at a distance of one metre.

    Raises:
        ValueError: If an argument is out of range.

    References:
        Wu et al., Phys. Med. Biol. 67 (2022) 194002: XCIST, which the tables are from.

    Example:
        >>> round(tube_spectrum(120.0).behind("aluminium", 3.0).mean_energy, 1)
        62.0
    """
    if not 70 <= tube_voltage_kvp <= 140:
        raise ValueError(f"The tube voltage must be from 70 to 140 kVp, got {tube_voltage_kvp}.")
    if bins is not None and bins < 8:
        raise ValueError(f"A spectrum needs at least 8 bins, got {bins}.")
    energies, voltages, tables = _tables()
    photons = np.array([np.interp(tube_voltage_kvp, voltages, row) for row in tables])
    if bins is None:
        return Spectrum(energies[photons > 0], photons[photons > 0])
    place = np.minimum(energies / tube_voltage_kvp * bins, bins - 1).astype(int)
    total = np.bincount(place, weights=photons, minlength=bins).astype(np.float64)
    weighted = np.bincount(place, weights=photons * energies, minlength=bins).astype(np.float64)
    return Spectrum(weighted[total > 0] / total[total > 0], total[total > 0])


@cache
def _tables() -> tuple[Array, Array, Array]:
    """Energies, voltages, and photons [energies, voltages]."""
    file = resources.files("pnpct.simulation").joinpath("tables/tungsten_7_degrees.csv")
    _, _, heading, *rows = file.read_text().splitlines()
    table = np.array([row.split(",") for row in rows], dtype=np.float64)
    voltages = np.array([float(name.removesuffix(" kVp")) for name in heading.split(",")[1:]])
    return table[:, 0], voltages, table[:, 1:]
