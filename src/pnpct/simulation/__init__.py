"""From anatomy to a scan: phantoms, x-ray spectra and a polychromatic scanner."""

from pnpct.simulation.chest import chest_phantom
from pnpct.simulation.materials import MATERIALS, Material, attenuation
from pnpct.simulation.phantom import Phantom, relative_attenuation, truth
from pnpct.simulation.scanner import (
    Beam,
    bowtie_thickness,
    clinical_fan_beam,
    moments_behind,
    scanner_beam,
    simulate_moments,
    simulate_scan,
    water_correction,
)
from pnpct.simulation.spectrum import Spectrum, tube_spectrum

__all__ = [
    "MATERIALS",
    "Beam",
    "Material",
    "Phantom",
    "Spectrum",
    "attenuation",
    "bowtie_thickness",
    "chest_phantom",
    "clinical_fan_beam",
    "moments_behind",
    "relative_attenuation",
    "scanner_beam",
    "simulate_moments",
    "simulate_scan",
    "truth",
    "tube_spectrum",
    "water_correction",
]
