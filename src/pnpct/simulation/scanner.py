"""A CT scanner of today: its geometry, what its detector sees of the beam, and the scans it makes."""

import math
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from numpy.typing import NDArray
from torch import Tensor

from pnpct.geometry import FanBeam, evenly_spaced_views
from pnpct.operators import Projector
from pnpct.physics import BeamHardening, Moments, Scan, fit_water_correction, scan_from_moments
from pnpct.simulation.materials import attenuation
from pnpct.simulation.phantom import Phantom, relative_attenuation
from pnpct.simulation.spectrum import tube_spectrum
from pnpct.units import MU_WATER_70_KEV

CELL_HEIGHT = 1.0963
"""Height of a detector cell, mm: slices of 0.625 mm at the isocentre."""
ELECTRONIC_NOISE_KEV = 206.0
"""Standard deviation of the electronic noise of a count, keV: 3500 electrons at 17 electrons per keV."""
OUTPUT = 0.508
"""Share of the modelled photons that is counted, cells not being all scintillator: gives CatSim's 34 800 quanta."""


@dataclass(frozen=True, eq=False)
class Beam:
    """What the detector absorbs of each energy without an object.

    Args:
        energies: Middle of each energy bin, keV.
        photons: Photons that each detector bin absorbs of each energy, per mAs.
    """

    energies: NDArray[np.float64]
    photons: Float[Tensor, "bins energies"]


def clinical_fan_beam(*, views: int = 984, bins: int = 900) -> FanBeam:
    """Return the geometry of CatSim's default scanner, with its whole fan of 56 degrees.

    541 mm from the focal spot to the isocentre, 949 mm to the detector, an arc of 921.5 mm shifted by a
    quarter of a cell, one full turn.

    Args:
        views: Views in the turn, at least 1.
        bins: Cells that share the arc, at least 1; 900 cells are 1.0239 mm wide.

    Example:
        >>> clinical_fan_beam().bin_width
        1.0239
    """
    return FanBeam(
        view_angles=evenly_spaced_views(views),
        bins=bins,
        source_to_isocenter=541.0,
        source_to_detector=949.0,
        bin_width=1.0239 * 900 / max(bins, 1),  # FanBeam says what is wrong with less than one
        detector_offset=0.25,
    )


def bowtie_thickness(fan_angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the aluminium of a bow-tie filter for large bodies at each fan angle, mm.

    2.6 mm + 33.9 mm · (1 − exp(−|γ / 0.261|^3.5)): within 0.7 mm of CatSim's large bow-tie.
    """
    return 2.6 + 33.9 * (1 - np.exp(-(np.abs(fan_angles / 0.261) ** 3.5)))


def scanner_beam(
    geometry: FanBeam,
    *,
    tube_voltage_kvp: float = 120.0,
    aluminium: float = 6.5,
    bowtie: bool = True,
    step: float = 3.0,
) -> Beam:
    """Return what each detector cell absorbs of each energy: tube, filters, distance, cell and scintillator.

    The scintillator is 3 mm of Gd₂O₂S; fluorescence, crosstalk and scatter are left out. With its defaults
    the beam is that of CatSim's default scanner at 120 kVp: the line integrals of a chest agree to 0.2 %, the
    energy of a quantum to 0.5 % at the middle and at the edge of the fan.

    Args:
        geometry: The scanner; the photons of a cell grow with its width.
        tube_voltage_kvp: Peak tube voltage, 70 to 140 kVp in the clinic.
        aluminium: Thickness of all flat filters, mm, ≥ 0, in which the tube itself has about 4 mm.
        bowtie: Whether the large bow-tie filter is in the beam.
        step: Width of the energy bins, keV.

    Returns:
        Absorbed photons per mAs. At 120 kVp the middle of the fan gets 34 800 effective quanta (S₁²/S₂) at 40
        mA in 1/984 s.

    Raises:
        ValueError: If an argument is out of its range.
    """
    spectrum = tube_spectrum(tube_voltage_kvp, step=step).behind("aluminium", aluminium)
    fan_angles = geometry.fan_angles
    slant = 1 / np.cos(fan_angles)
    metal = aluminium * (slant - 1) + (bowtie_thickness(fan_angles) if bowtie else 0.0)
    passed = np.exp(-metal[:, None] * attenuation("aluminium", spectrum.energies))
    absorbed = -np.expm1(-3.0 * attenuation("gadolinium oxysulfide", spectrum.energies))
    area = geometry.bin_width * CELL_HEIGHT * (1000 / geometry.source_to_detector) ** 2
    return Beam(spectrum.energies, torch.from_numpy(OUTPUT * area * spectrum.photons * absorbed * passed))


def water_correction(beam: Beam) -> BeamHardening:
    """Return the correction after which water looks as it does at 70 keV, for paths up to 500 mm."""
    response = beam.photons * torch.from_numpy(beam.energies)
    mu_water = relative_attenuation(("water",), beam.energies)[0]
    return fit_water_correction(response, mu_water, mu_effective=MU_WATER_70_KEV)


def simulate_moments(phantom: Phantom, geometry: FanBeam, beam: Beam) -> Moments:
    """Return the noise-free signal of a polychromatic scan, and its variance, for 1 mAs per view.

    `physics.scan_from_moments` draws scans of any tube current from it. Focal spot and rotation during a view
    are left out; a cell averages the paths over its width.

    Args:
        phantom: The object.
        geometry: The scanner.
        beam: What its detector absorbs without object, of the same number of bins.

    Returns:
        Moments in keV and keV², on the phantom's device.

    Raises:
        ValueError: If the beam has another number of bins, or the geometry cannot see the phantom.
    """
    if len(beam.photons) != geometry.bins:
        raise ValueError(f"The beam is for {len(beam.photons)} bins, the geometry has {geometry.bins}.")
    solid = [index for index, material in enumerate(phantom.materials) if material != "air"]
    paths = Projector(phantom.grid, geometry, mu_water=1.0)(phantom.fractions[solid])
    return moments_behind(paths, tuple(phantom.materials[index] for index in solid), beam)


def moments_behind(paths: Float[Tensor, "materials views bins"], materials: tuple[str, ...], beam: Beam) -> Moments:
    """Return the mean and the variance of the signal behind given materials, for 1 mAs per view.

    With L_m the path in material m and λ_E the photons that the cell absorbs without object,

        S_k = Σ_E λ_E E^k exp(−Σ_m (μ_m(E) − μ_air(E)) L_m),   k = 1, 2.

    Args:
        paths: Length of each ray in each material, mm.
        materials: Names in `MATERIALS`.
        beam: What the detector absorbs without object.

    Returns:
        Moments in keV and keV², with the electronic noise of one count, on the paths' device.

    Raises:
        ValueError: If a material is unknown.
    """
    mu = relative_attenuation(materials, beam.energies).to(paths)
    powers = torch.from_numpy(np.stack([beam.energies, beam.energies**2]))
    absorbed = (beam.photons[:, None] * powers).to(paths)
    # View by view: all energies of all rays at once would fill the memory.
    signal = [torch.einsum("be,bke->kb", torch.exp(-view.T @ mu), absorbed) for view in paths.unbind(dim=1)]
    mean, variance = torch.stack(signal, dim=1)
    air_mean, air_variance = absorbed.sum(dim=2).T
    return Moments(mean, variance, air_mean, air_variance, electronic_noise=ELECTRONIC_NOISE_KEV)


def simulate_scan(
    phantom: Phantom,
    geometry: FanBeam,
    *,
    tube_current_ma: float,
    tube_voltage_kvp: float = 120.0,
    rotation_time: float = 1.0,
    generator: torch.Generator | None,
) -> Scan:
    """Scan a phantom once, as a scanner with an energy-integrating detector does.

    For several scans of one phantom (pairs, doses) call `simulate_moments` once and
    `physics.scan_from_moments` for each.

    Args:
        phantom: The object.
        geometry: The scanner; see `clinical_fan_beam`.
        tube_current_ma: Tube current, mA, > 0.
        tube_voltage_kvp: Peak tube voltage, 40 to 150 kVp.
        rotation_time: Time of all views together, s, > 0.
        generator: Source of the noise, on the phantom's device; None for a scan without noise.

    Returns:
        Counts with compound Poisson and electronic noise, with the water correction to 70 keV attached.

    Raises:
        ValueError: If an argument is out of its range, or the geometry cannot see the phantom.
    """
    for name, value, unit in (
        ("tube_current_ma", tube_current_ma, "mA"),
        ("rotation_time", rotation_time, "s"),
    ):
        if not (math.isfinite(value) and value > 0):
            raise ValueError(f"{name} must be positive, in {unit}, got {value}.")
    beam = scanner_beam(geometry, tube_voltage_kvp=tube_voltage_kvp)
    return scan_from_moments(
        simulate_moments(phantom, geometry, beam),
        geometry,
        mu_water=MU_WATER_70_KEV,
        dose_fraction=tube_current_ma * rotation_time / geometry.views,
        beam_hardening=water_correction(beam),
        generator=generator,
    )
