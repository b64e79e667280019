"""The noise and the logarithm against a chest that CatSim, an independent simulator, has scanned."""

import json
import math
from dataclasses import dataclass

import numpy as np
import pytest
import torch

from pnpct.geometry import FanBeam, evenly_spaced_views
from pnpct.physics import BeamHardening, Moments, scan_from_moments, take_log
from pnpct.units import MU_WATER_70_KEV

REFERENCE_MA = 800.0


@dataclass(frozen=True)
class Chest:
    moments: Moments
    geometry: FanBeam
    line_integrals: torch.Tensor
    beam_hardening: BeamHardening


@pytest.fixture(scope="module")
def chest(shared_data):
    folder = shared_data / "catsim" / "chest"

    def array(file, name):
        with np.load(folder / file) as archive:
            return torch.from_numpy(archive[name])

    about = json.loads((folder / "geometry.json").read_text())
    moments = Moments(
        signal_mean=array("signal_mean_800mA.npz", "S1"),
        signal_variance=array("signal_var_800mA.npz", "S2"),
        air_mean=array("signal_mean_800mA.npz", "air_S1"),
        air_variance=array("signal_var_800mA.npz", "air_S2"),
        electronic_noise=about["eNoise_e"] / about["gain_e_per_keV"],
    )
    geometry = FanBeam(
        view_angles=evenly_spaced_views(about["n_views"]),
        bins=about["n_cols"],
        source_to_isocenter=about["sid_mm"],
        source_to_detector=about["sdd_mm"],
        bin_width=about["col_pitch_mm"],
        detector_offset=about["col_offset_cols"],
    )
    coefficients = array("bhc_poly.npz", "coef")
    return Chest(moments, geometry, array("prep_clean.npz", "prep"), BeamHardening(coefficients))


@pytest.fixture(scope="module")
def at_40_ma(chest):
    generator = torch.Generator().manual_seed(40)
    return scan_from_moments(
        chest.moments,
        chest.geometry,
        mu_water=MU_WATER_70_KEV,
        dose_fraction=40 / REFERENCE_MA,
        generator=generator,
    )


def test_the_log_of_the_clean_scan_is_that_of_catsim(chest):
    scan = scan_from_moments(chest.moments, chest.geometry, mu_water=MU_WATER_70_KEV, generator=None)
    ample = (scan.counts > 100) & (chest.line_integrals > 0)
    assert ample.float().mean() > 0.6
    line_integrals = take_log(scan).line_integrals
    torch.testing.assert_close(line_integrals[ample], chest.line_integrals[ample], rtol=0, atol=2e-5)


def test_the_noise_at_40_ma_has_the_mean_and_variance_of_the_moments(chest, at_40_ma):
    moments, dose = chest.moments, 40 / REFERENCE_MA
    mean = dose * moments.signal_mean / moments.quantum
    variance = (dose * moments.signal_variance + moments.electronic_noise**2) / moments.quantum**2
    z_scores = (at_40_ma.counts - mean) / variance.sqrt()
    brightness = mean.flatten().argsort().chunk(20)  # from the darkest twentieth of the rays to the brightest
    for rays in brightness:
        chosen = z_scores.flatten()[rays]
        assert abs(float(chosen.mean())) < 4 / math.sqrt(len(rays))
        assert float(chosen.var()) == pytest.approx(1.0, abs=4 * math.sqrt(2.1 / len(rays)))


def test_weights_at_40_ma_are_near_one_over_the_variance(chest, at_40_ma):
    sinogram = take_log(at_40_ma)
    errors = (
        sinogram.line_integrals
        - take_log(
            scan_from_moments(chest.moments, chest.geometry, mu_water=MU_WATER_70_KEV, generator=None)
        ).line_integrals
    )
    in_air, in_body = chest.line_integrals < 0.01, chest.line_integrals > 3.0
    scores = errors.square() * sinogram.weights.diagonal
    assert float(scores[in_air].mean()) == pytest.approx(1.0, abs=0.03)
    # Behind the body the hardened quanta are larger than those of air, and their variance with them.
    assert 1.0 < float(scores[in_body].mean()) < 1.2


def test_the_correction_of_catsim_is_accepted_and_hardens_the_weights(chest, at_40_ma):
    scan = scan_from_moments(
        chest.moments,
        chest.geometry,
        mu_water=MU_WATER_70_KEV,
        beam_hardening=chest.beam_hardening,
        generator=None,
    )
    sinogram = take_log(scan)
    dense = chest.line_integrals > 5.0
    assert (sinogram.line_integrals[dense] > chest.line_integrals[dense] * 0.95).all()
    slope = chest.beam_hardening.slope(chest.line_integrals)
    torch.testing.assert_close(
        sinogram.weights.diagonal[dense].mean() * slope[dense].square().mean(),
        scan.counts[dense].mean(),
        rtol=0.05,
        atol=0,
    )
