"""Beam hardening by tissues: errors of soft tissue with and without its correction, in scans without noise.

    python benchmarks/bone.py [SEED]

Procedural heads, pelves, abdomens and chests of two patients, at three heights, at 80, 100 and 120 kVp; FBP "hann".
"Streaks" is the standard deviation in soft tissue, after a blur of 4 pixels, of the difference from FBP of the truth
itself. The first of two columns is without the correction.
"""

import sys
from dataclasses import replace

import numpy as np
import torch

from pnpct.arrays import Image
from pnpct.denoisers import Gaussian
from pnpct.evaluation import soft_tissue_mask
from pnpct.operators import Projector
from pnpct.physics import Sinogram, take_log
from pnpct.reconstruction import FBP, fbp
from pnpct.simulation import as_exposure, clinical_fan_beam, procedural_patient, scanner_beam, simulate_moments, truth


def main(seed: int) -> None:
    """Print a row for each scan."""
    print(f"{'':22} {'bias, HU':>16} {'RMSE, HU':>16} {'streaks, HU':>16}")
    geometry = clinical_fan_beam()
    beams = {voltage: scanner_beam(geometry, tube_voltage_kvp=voltage) for voltage in (80.0, 100.0, 120.0)}
    for anatomy in ("head", "pelvis", "abdomen", "chest"):
        for patient in range(2):
            source = procedural_patient(anatomy, np.random.default_rng(seed + patient))
            low, high = source.body.extent
            for share in (0.25, 0.5, 0.75):
                phantom = source.body.slice(low + share * (high - low), source.grid.halved)
                moments = simulate_moments(phantom, geometry, [*beams.values()])
                for (voltage, beam), each in zip(beams.items(), moments, strict=True):
                    scan = as_exposure(each, geometry, beam).scan(tube_current_ma=1e4, generator=None)
                    wanted = truth(phantom, source.grid, energy=beam.effective_energy)
                    A = Projector(source.grid, geometry, mu_water=scan.mu_water)
                    name = f"{anatomy} {patient}, {share:.2f}, {voltage:g} kVp"
                    _row(name, take_log(scan), A, wanted)


def _row(name: str, sinogram: Sinogram, A: Projector, wanted: Image) -> None:
    soft = soft_tissue_mask(wanted)
    ideal = fbp(A(wanted), A, kernel="hann") - wanted
    images = [FBP()(each, A).image for each in (replace(sinogram, bone=None), sinogram)]
    errors = [1000 * (image - wanted) for image in images]
    of_spectrum = [Gaussian(4.0)(error - 1000 * ideal)[soft] for error in errors]
    bias, rmse = ([f(error[soft]) for error in errors] for f in (torch.mean, lambda e: e.square().mean().sqrt()))
    streaks = [error.std() for error in of_spectrum]
    print(f"{name:22}", *(f"{float(b):7.1f} {float(a):7.1f} " for b, a in (bias, rmse, streaks)), flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 950)
