"""Incident counts of another exposure, and modules of the detector that fail: found, and nothing else."""

import numpy as np
import pytest
from disc_scans import BINS, GEOMETRY, MU, VIEWS, chords

from pnpct.files import import_arrays
from pnpct.files.measured_rays import offset_of_air


@pytest.fixture(scope="module")
def line_integrals():
    return chords()


@pytest.mark.parametrize("offset", [0.1, 0.4, -0.3])
@pytest.mark.parametrize("noise", [True, False])
def test_incident_counts_of_another_exposure_are_said(line_integrals, offset, noise):
    """Water was 11, 42 and -32 HU, and the second one was called an object beyond the fan."""
    counts = 1e5 * np.exp(-line_integrals)
    counts = np.random.default_rng(9).poisson(counts).astype(float) if noise else counts
    made = import_arrays(counts, GEOMETRY, kind="counts", incident=1e5 * np.exp(offset), mu_water=MU)
    assert offset_of_air(np.log(1e5 * np.exp(offset) / counts)) == pytest.approx(offset, abs=2e-3)
    assert any(f"the incident counts are {np.exp(offset):.3g}"[:-1] in note for note in made.notes)


@pytest.mark.parametrize("part", [slice(None), slice(64, 192), slice(40, 200), slice(100, 256)])
def test_rays_through_an_object_that_is_cut_off_are_no_air(line_integrals, part):
    assert offset_of_air(line_integrals[:, part]) == 0


def module_fails(counts):
    counts[VIEWS // 2 :, 140:172] = 0


def edge_fails(counts):
    counts[: VIEWS // 2, :30] = 0


def module_is_noise(counts):
    counts[VIEWS // 2 :, 140:172] = np.random.default_rng(8).normal(0, 3, (VIEWS - VIEWS // 2, 32))


def module_sticks(counts):
    counts[:, 140:172] = 500


def module_saturates(counts):
    counts[:, 60:92] = 1e5


@pytest.mark.parametrize("change", [module_fails, edge_fails, module_is_noise, module_sticks, module_saturates])
def test_a_module_of_the_detector_that_fails_is_left_out_and_nothing_else(line_integrals, change):
    """It made water -800, 1024 or -647 HU, without a word."""
    counts = np.random.default_rng(7).poisson(1e5 * np.exp(-line_integrals)).astype(float)
    whole = counts.copy()
    change(counts)
    made = import_arrays(counts, GEOMETRY, kind="counts", incident=1e5, electronic_noise=3.0, mu_water=MU)
    lost = ~made.scan.measured.expand(VIEWS, BINS).numpy()
    assert np.array_equal(lost, counts != whole)
    assert "were left out as" in made.notes[0]
