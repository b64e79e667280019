"""The beam as the detector sees it: tube, filters, distance and detector."""

import math
from dataclasses import dataclass
from functools import cache, lru_cache
from importlib import resources
from typing import Literal, TypeAlias

import numpy as np
import torch
from jaxtyping import Float
from numpy.typing import NDArray
from torch import Tensor

from pnpct.geometry import FanBeam
from pnpct.geometry.short_repr import short_repr
from pnpct.physics import TUBE_VOLTAGE_KVP, BeamHardening, fit_water_correction, with_bone
from pnpct.simulation.materials import attenuation
from pnpct.simulation.phantom import relative_attenuation
from pnpct.simulation.spectrum import tube_spectrum

CELL_HEIGHT = 1.0963
"""Height of a detector cell, mm: slices of 0.625 mm at the isocentre."""
ACTIVE_AREA = 0.81
"""Fraction of a cell that detects, 0.9 along columns and rows."""
ELECTRONIC_NOISE_KEV = 3500 / 17
"""Standard deviation of the electronic noise of an energy-integrating cell: 3500 electrons at 17 per keV."""
TYPICAL_PATH = 200.0
"""Length in water, mm, behind which the effective energy of a beam is stated."""

Bowtie: TypeAlias = Literal["large", "medium", "small", "none"]
"""Bow-tie filters, by the body that they are for."""

Detector: TypeAlias = Literal["energy-integrating", "photon-counting"]
"""What a detector makes of a photon: its energy, or one count."""

BOWTIE: Bowtie = "large"
DETECTOR: Detector = "energy-integrating"
"""Of scans where nothing else is said."""


@dataclass(frozen=True, eq=False)
class Beam:
    """What a detector absorbs of each energy without an object, and what signal that gives.

    Args:
        energies: Energy of each bin, keV.
        photons: Photons that each detector bin absorbs of each energy, per mAs.
        response: Signal of one photon of each energy: keV, or counts.
        electronic_noise: Standard deviation of the electronic noise, in the unit of the signal.
    """

    energies: NDArray[np.float64]
    photons: Float[Tensor, "bins energies"]
    response: Float[Tensor, "energies"]
    electronic_noise: float

    __repr__ = short_repr

    @property
    def effective_energy(self) -> float:
        """Energy at which a contrast inside a body looks as it does to this beam, keV.

        Its attenuation in water is that of a thin layer behind 200 mm of water in the middle of the fan, where
        the body has hardened the beam.
        """
        mu_water = relative_attenuation(("water",), self.energies)[0]
        signal = self.photons[len(self.photons) // 2] * self.response * torch.exp(-mu_water * TYPICAL_PATH)
        mean_mu = float((signal * mu_water).sum() / signal.sum())
        energies = np.arange(30.0, 140.0, 0.25)
        falling = relative_attenuation(("water",), energies)[0].numpy()
        return float(np.interp(-mean_mu, -falling, energies))


def scanner_beam(
    geometry: FanBeam,
    *,
    tube_voltage_kvp: float = TUBE_VOLTAGE_KVP,
    aluminium: float = 3.0,
    bowtie: Bowtie = BOWTIE,
    detector: Detector = DETECTOR,
    threshold: float = 25.0,
    energy_bins: int = 20,
) -> Beam:
    """Return what each detector cell absorbs of each energy: tube, filters, distance and cell.

    The energy-integrating detector is 3 mm of the ceramic scintillator (Y,Gd,Eu)₂O₃ behind 1 mm of carbon; its
    signal is the absorbed energy in keV. The photon-counting one is 2 mm of cadmium telluride; it counts each
    photon above a threshold once and has no electronic noise. Fluorescence, charge sharing, pile-up and
    scatter are left out. With its defaults the beam is that of CatSim's default scanner.

    Args:
        geometry: The scanner; the photons of a cell grow with its width.
        tube_voltage_kvp: Peak tube voltage, 70 to 140 kVp.
        aluminium: Thickness of the flat filter, mm, ≥ 0.
        bowtie: Bow-tie filter: for large, medium or small bodies, or none.
        detector: Kind of detector.
        threshold: Lowest energy that a photon-counting detector counts, keV, > 0.
        energy_bins: Bins that the energies are sorted into, at least 8.

    Returns:
        Absorbed photons per mAs. At 120 kVp the middle of the fan gets 34 800 effective quanta (S₁²/S₂) at 40
        mA in 1/984 s.

    Raises:
        ValueError: If an argument is out of range.
    """
    if not (math.isfinite(threshold) and threshold > 0):
        raise ValueError(f"The threshold of a photon-counting detector must be positive, in keV, got {threshold}.")
    spectrum = tube_spectrum(tube_voltage_kvp, bins=energy_bins).behind("aluminium", aluminium)
    energies, fan_angles = spectrum.energies, geometry.fan_angles
    metal = aluminium * (1 / np.cos(fan_angles) - 1) + bowtie_thickness(fan_angles, bowtie)
    passed = np.exp(-metal[:, None] * attenuation("aluminium", energies))
    if detector == "energy-integrating":
        absorbed = -np.expm1(-3.0 * attenuation("scintillator", energies)) * np.exp(-attenuation("carbon", energies))
        response, noise = torch.from_numpy(energies), ELECTRONIC_NOISE_KEV
    else:
        absorbed = -np.expm1(-2.0 * attenuation("cadmium telluride", energies))
        response, noise = torch.from_numpy((energies >= threshold).astype(np.float64)), 0.0
    area = ACTIVE_AREA * geometry.bin_width * CELL_HEIGHT * (1000 / geometry.source_to_detector) ** 2
    photons = torch.from_numpy(area * spectrum.photons * absorbed * passed)
    return Beam(energies, photons, response, noise)


def bowtie_thickness(fan_angles: NDArray[np.float64], bowtie: Bowtie = BOWTIE) -> NDArray[np.float64]:
    """Return the aluminium of a bow-tie filter at each fan angle, mm, as CatSim's tables have it.

    Beyond the tables, at 0.477 rad, it stays what it is there.
    """
    if bowtie == "none":
        return np.zeros_like(fan_angles)
    angles, thickness = _bowties()
    return np.interp(fan_angles, angles, thickness[bowtie])


@lru_cache(maxsize=8)
def hardening_correction(beam: Beam) -> BeamHardening:
    """Return the correction after which water, and with it bone, look as they do at the effective energy of a beam."""
    materials = ("water", "cortical bone")
    mu_water, mu_bone = relative_attenuation(materials, beam.energies)
    of_water, of_bone = relative_attenuation(materials, np.array([beam.effective_energy]))[:, 0].tolist()
    detected = beam.photons * beam.response
    water = fit_water_correction(detected, mu_water, mu_effective=of_water)
    return with_bone(water, detected, mu_water, mu_bone, mu_effective=(of_water, of_bone))


def effective_mu_water(beam: Beam) -> float:
    """Return the attenuation of water, less that of air, at the effective energy of a beam, 1/mm."""
    return float(relative_attenuation(("water",), np.array([beam.effective_energy]))[0, 0])


@cache
def _bowties() -> tuple[NDArray[np.float64], dict[str, NDArray[np.float64]]]:
    file = resources.files("pnpct.simulation").joinpath("tables/bowties.csv")
    _, _, heading, *rows = file.read_text().splitlines()
    table = np.array([row.split(",") for row in rows], dtype=np.float64)
    return table[:, 0], dict(zip(heading.split(",")[1:], table[:, 1:].T, strict=True))
