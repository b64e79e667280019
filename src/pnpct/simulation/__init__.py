"""From anatomy to a scan: phantoms, x-ray spectra and a polychromatic scanner."""

from pnpct.simulation.anatomy import ANATOMIES, abdomen_body, chest_body, head_body, pelvis_body
from pnpct.simulation.beam import (
    BOWTIE,
    DETECTOR,
    Beam,
    Bowtie,
    Detector,
    bowtie_thickness,
    effective_mu_water,
    hardening_correction,
    scanner_beam,
)
from pnpct.simulation.body import Body
from pnpct.simulation.catsim import CatSimSampling, catsim_moments
from pnpct.simulation.ct_body import CTBody
from pnpct.simulation.dataset import simulate_dataset
from pnpct.simulation.example import example_scan
from pnpct.simulation.lesions import with_lesions
from pnpct.simulation.low_contrast import CCT189, low_contrast_phantom
from pnpct.simulation.materials import MATERIALS, Material, attenuation
from pnpct.simulation.phantom import Phantom, relative_attenuation, truth
from pnpct.simulation.recipe import Recipe, Simulator, plan
from pnpct.simulation.scanner import (
    BINS,
    BLURRED,
    SLICE_THICKNESS,
    TUBE_CURRENT_MA,
    VIEWS,
    Sampling,
    as_exposure,
    clinical_fan_beam,
    expose,
    moments_behind,
    simulate_moments,
)
from pnpct.simulation.sources import Source, fingerprint, from_files, procedural_patient
from pnpct.simulation.spectrum import Spectrum, tube_spectrum
from pnpct.simulation.voxel_body import VoxelBody

__all__ = [
    "ANATOMIES",
    "BINS",
    "BLURRED",
    "BOWTIE",
    "CCT189",
    "DETECTOR",
    "MATERIALS",
    "SLICE_THICKNESS",
    "TUBE_CURRENT_MA",
    "VIEWS",
    "Beam",
    "Body",
    "Bowtie",
    "CTBody",
    "CatSimSampling",
    "Detector",
    "Material",
    "Phantom",
    "Recipe",
    "Sampling",
    "Simulator",
    "Source",
    "Spectrum",
    "VoxelBody",
    "abdomen_body",
    "as_exposure",
    "attenuation",
    "bowtie_thickness",
    "catsim_moments",
    "chest_body",
    "clinical_fan_beam",
    "effective_mu_water",
    "example_scan",
    "expose",
    "fingerprint",
    "from_files",
    "hardening_correction",
    "head_body",
    "low_contrast_phantom",
    "moments_behind",
    "pelvis_body",
    "plan",
    "procedural_patient",
    "relative_attenuation",
    "scanner_beam",
    "simulate_dataset",
    "simulate_moments",
    "truth",
    "tube_spectrum",
    "with_lesions",
]
