"""From detected counts to data: scans and their noise, line integrals and their weights."""

from pnpct.physics.beam_hardening import BeamHardening, fit_water_correction, with_bone
from pnpct.physics.bone_hardening import BoneHardening
from pnpct.physics.exposure import TUBE_VOLTAGE_KVP, Exposure
from pnpct.physics.half_turn import column_shift, half_turn_views
from pnpct.physics.incident_estimate import MOST_QUANTA, estimate_incident
from pnpct.physics.scan import Moments, Scan, scan_from_moments, simulate_counts
from pnpct.physics.sinogram import Sinogram, take_log
from pnpct.physics.unmeasured import dead_cells, fill_along_detector, lost_readings, stuck_cells, unmeasured_and_dead
from pnpct.physics.weights import BandedWeights, DiagonalWeights, Weights

__all__ = [
    "MOST_QUANTA",
    "TUBE_VOLTAGE_KVP",
    "BandedWeights",
    "BeamHardening",
    "BoneHardening",
    "DiagonalWeights",
    "Exposure",
    "Moments",
    "Scan",
    "Sinogram",
    "Weights",
    "column_shift",
    "dead_cells",
    "estimate_incident",
    "fill_along_detector",
    "fit_water_correction",
    "half_turn_views",
    "lost_readings",
    "scan_from_moments",
    "simulate_counts",
    "stuck_cells",
    "take_log",
    "unmeasured_and_dead",
    "with_bone",
]
