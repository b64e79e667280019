"""A slice in a beam: all that is needed to draw its scans at any dose level."""

import math
from dataclasses import dataclass

import torch

from pnpct.geometry import FanBeam
from pnpct.physics.beam_hardening import BeamHardening
from pnpct.physics.scan import Moments, Scan, scan_from_moments

TUBE_VOLTAGE_KVP = 120.0
"""Peak tube voltage where nothing else is said, kVp."""


@dataclass(frozen=True, eq=False)
class Exposure:
    """The moments of a slice for 1 mAs in each view, with what is needed to draw a scan.

    Args:
        moments: Mean and variance of the signal for 1 mAs in each view.
        geometry: Where the rays are.
        mu_water: Attenuation of water, less that of air, at the effective energy, 1/mm.
        beam_hardening: Correction of the line integrals to that energy; None for a beam of one energy.
    """

    moments: Moments
    geometry: FanBeam
    mu_water: float
    beam_hardening: BeamHardening | None

    def scan(self, *, tube_current_ma: float, rotation_time: float = 1.0, generator: torch.Generator | None) -> Scan:
        """Draw a scan.

        Args:
            tube_current_ma: Tube current, mA, > 0.
            rotation_time: Rotation time, of all views together, s, > 0.
            generator: Generator of the noise, on the device of the moments; None for the mean counts.

        Raises:
            ValueError: If a number is out of range, or the moments do not fit the geometry.
        """
        for name, value, unit in (("tube_current_ma", tube_current_ma, "mA"), ("rotation_time", rotation_time, "s")):
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"{name} must be positive, in {unit}, got {value}.")
        return scan_from_moments(
            self.moments,
            self.geometry,
            mu_water=self.mu_water,
            dose_fraction=tube_current_ma * rotation_time / self.geometry.views,
            beam_hardening=self.beam_hardening,
            generator=generator,
        )
