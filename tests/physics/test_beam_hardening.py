import math

import numpy as np
import pytest
import torch

from pnpct.physics import BeamHardening, fit_water_correction

ENERGIES = torch.linspace(20.0, 119.0, 100, dtype=torch.float64)
# Near enough to water: the photoelectric effect falls with the cube of the energy, Compton scatter hardly.
MU_WATER = 0.018 * (30.0 / ENERGIES) ** 3 + 0.019 * (60.0 / ENERGIES) ** 0.35
MU_EFFECTIVE = float(MU_WATER[50])


@pytest.fixture(scope="module")
def spectra():
    """A tube at 120 kVp behind thin and thick filters, seen by a detector that integrates energy."""
    filters = torch.tensor([3.0, 10.0, 40.0])[:, None]
    return (120.0 / ENERGIES - 1) * torch.exp(-0.3 * filters * (30.0 / ENERGIES) ** 3) * ENERGIES


@pytest.fixture(scope="module")
def hardening(spectra):
    return fit_water_correction(spectra, MU_WATER, mu_effective=MU_EFFECTIVE)


def measure(spectra, lengths):
    transmission = (spectra[:, None] * torch.exp(-lengths[:, None] * MU_WATER)).sum(-1) / spectra.sum(-1)[:, None]
    return -transmission.log().T


def test_water_looks_as_if_scanned_with_one_energy(spectra, hardening):
    lengths = torch.linspace(0.0, 480.0, 97, dtype=torch.float64)
    corrected = hardening.correct(measure(spectra, lengths))
    uncorrected = measure(spectra, lengths) - MU_EFFECTIVE * lengths[:, None]
    assert uncorrected.abs().max() > 0.3
    torch.testing.assert_close(corrected, (MU_EFFECTIVE * lengths)[:, None].expand(97, 3), rtol=0, atol=4e-3)


def test_an_unhardened_beam_is_only_scaled():
    one_energy = torch.zeros(1, len(ENERGIES), dtype=torch.float64)
    one_energy[0, 30] = 7.0
    hardening = fit_water_correction(one_energy, MU_WATER, mu_effective=MU_EFFECTIVE)
    line_integrals = torch.linspace(0, 9, 10, dtype=torch.float64)[:, None]
    torch.testing.assert_close(hardening.correct(line_integrals), line_integrals * MU_EFFECTIVE / MU_WATER[30])


def test_no_attenuation_stays_none(hardening):
    assert torch.equal(hardening.correct(torch.zeros(1, 3)), torch.zeros(1, 3))


def test_the_correction_agrees_with_numpy_polyval(hardening):
    line_integrals = torch.linspace(0.0, 9.9, 30, dtype=torch.float64)[:, None].expand(30, 3)
    expected = [np.polyval(hardening.coefficients[number].numpy(), line_integrals[:, number]) for number in range(3)]
    torch.testing.assert_close(hardening.correct(line_integrals), torch.from_numpy(np.stack(expected, axis=1)))


def test_single_precision_agrees_with_double(hardening):
    line_integrals = torch.linspace(0.0, 9.9, 90).reshape(30, 3)
    corrected = hardening.correct(line_integrals)
    assert corrected.dtype == torch.float32
    torch.testing.assert_close(corrected.double(), hardening.correct(line_integrals.double()), rtol=1e-6, atol=1e-6)


def test_the_slope_is_that_of_finite_differences_inside_and_beyond_the_range(hardening):
    line_integrals = torch.linspace(-1.0, 14.0, 61, dtype=torch.float64)[:, None].expand(61, 3) + 0.05
    step = 1e-5
    difference = hardening.correct(line_integrals + step) - hardening.correct(line_integrals - step)
    torch.testing.assert_close(hardening.slope(line_integrals), difference / (2 * step), rtol=1e-7, atol=0)


def test_a_wild_polynomial_does_not_reach_noise_beyond_its_range():
    hardening = BeamHardening(torch.tensor([[1e-4, 0.0, 0.0, 0.0, 1.0, 0.0]]))
    slope_at_the_end = 1 + 5e-4 * 10.0**4
    end = 10.0 + 1e-4 * 10.0**5
    beyond = hardening.correct(torch.tensor([[-2.0, 13.0]]))
    torch.testing.assert_close(beyond, torch.tensor([[-2.0, end + 3 * slope_at_the_end]]))


def test_one_row_serves_all_bins():
    one = BeamHardening(torch.tensor([[0.01, 1.0, 0.0]]))
    three = BeamHardening(torch.tensor([[0.01, 1.0, 0.0]] * 3))
    line_integrals = torch.rand(2, 5, 3)
    torch.testing.assert_close(one.correct(line_integrals), three.correct(line_integrals))


def test_rays_of_another_detector_are_refused(hardening):
    with pytest.raises(ValueError, match="for 3 bins, the line integrals have 4"):
        hardening.correct(torch.ones(2, 4))


@pytest.mark.parametrize(
    ("coefficients", "sentence"),
    [
        (torch.tensor([[1.0, 0.0], [-1.0, 0.0]]), "bin 1 has the slope -1 at 0.0"),
        (torch.tensor([[-0.1, 1.0, 0.0]]), "bin 0 has the slope -1 at 10.0"),
        (torch.tensor([[math.nan, 0.0]]), "finite coefficients"),
        (torch.tensor([[1.0]]), "must rise"),
        (torch.zeros(0, 2), r"the shape \(0, 2\)"),
    ],
)
def test_corrections_that_are_none_are_refused(coefficients, sentence):
    with pytest.raises(ValueError, match=sentence):
        BeamHardening(coefficients)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"order": 0}, "at least 1, got 0"),
        ({"mu_effective": -0.02}, "mu_effective must be positive and finite, got -0.02"),
        ({"longest": math.inf}, "longest must be positive and finite, got inf"),
        ({"mu_water": -MU_WATER}, "attenuation of water must be positive"),
        ({"detected_spectrum": torch.zeros(3, 100)}, "every bin must detect something"),
        ({"order": 3, "longest": 20.0}, "must rise from 0 to 10, but .* longer paths, or with fewer powers"),
    ],
)
def test_fits_that_mean_nothing_are_refused(spectra, changes, sentence):
    possible = {"detected_spectrum": spectra, "mu_water": MU_WATER, "mu_effective": MU_EFFECTIVE}
    with pytest.raises(ValueError, match=sentence):
        fit_water_correction(**(possible | changes))
