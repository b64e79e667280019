"""Noise, sharpness and detectability from images of a phantom: closed forms in white noise."""

import math

import numpy as np
import pytest
import torch

from pnpct.evaluation import (
    EyeFilter,
    NoisePower,
    matched_filter_d_prime,
    measure_phantom,
    noise_power_of_repeats,
    patches_in_square,
)
from pnpct.geometry import ImageGrid
from pnpct.units import from_hu

GRID = ImageGrid(96, 96, 0.5, center=(10.0, -5.0))
DISC = (18.0, -5.0, 12.0)
UNIFORM = (-2.0, -5.0, 16.0)
NOISE_HU, CONTRAST_HU = 10.0, 200.0


def sharp(frequencies):
    return np.ones_like(frequencies)


@pytest.fixture(scope="module")
def phantom() -> torch.Tensor:
    """Twenty images of water with a disc, sharp but for pixels, in white noise."""
    draw = np.random.default_rng(1)
    fine = (np.arange(8) - 3.5) / 8 * GRID.spacing
    x, y = (GRID.x[:, None] + fine).ravel(), (GRID.y[:, None] - fine).ravel()
    inside = np.hypot(x[None, :] - DISC[0], y[:, None] - DISC[1]) < DISC[2] / 2
    share = inside.reshape(96, 8, 96, 8).mean(axis=(1, 3))
    return from_hu(torch.from_numpy(CONTRAST_HU * share + draw.normal(0, NOISE_HU, (20, 96, 96))))


@pytest.mark.parametrize("repeats", [1, 20])
def test_white_noise_has_its_standard_deviation_and_the_disc_its_contrast(phantom, repeats) -> None:
    found = measure_phantom(phantom[:repeats], GRID, uniform=UNIFORM, disc=DISC)
    # A polynomial of second order takes 6 of 32 x 32 degrees of freedom.
    assert found.values["noise_hu"] == pytest.approx(NOISE_HU, rel=0.05)
    assert found.values["contrast_hu"] == pytest.approx(CONTRAST_HU, rel=0.02)
    assert found.transfer is not None
    assert found.transfer.center == pytest.approx(DISC[:2], abs=0.1)
    # A pixel has a transfer of sinc(f spacing): 0.5 at 0.603 / spacing.
    assert found.values["f50_per_mm"] == pytest.approx(0.603 / GRID.spacing, rel=0.15)


def test_in_white_noise_the_matched_filter_sees_the_energy_of_the_disc() -> None:
    frequencies = np.fft.fftshift(np.fft.fftfreq(64, GRID.spacing))
    power = NoisePower(frequencies, np.full((64, 64), (NOISE_HU * GRID.spacing) ** 2))
    diameter = 8.0
    energy = 20**2 * math.pi * (diameter / 2) ** 2
    expected = math.sqrt(energy / (NOISE_HU * GRID.spacing) ** 2)
    d_prime = matched_filter_d_prime(power, sharp, contrast_hu=-20, diameter=diameter)
    assert d_prime == pytest.approx(expected, rel=0.02)  # less the energy beyond the Nyquist frequency
    assert matched_filter_d_prime(power, sharp, contrast_hu=40, diameter=diameter) == pytest.approx(2 * d_prime)
    with_eye = matched_filter_d_prime(power, sharp, contrast_hu=-20, diameter=diameter, eye=EyeFilter())
    assert 0 < with_eye < d_prime


def test_a_lesion_is_found_by_what_was_measured(phantom) -> None:
    found = measure_phantom(phantom, GRID, uniform=UNIFORM, disc=DISC, lesion=(20.0, 8.0))
    assert found.transfer is not None
    expected = matched_filter_d_prime(found.power, found.transfer, contrast_hu=20.0, diameter=8.0)
    assert found.values["d_prime_npw"] == expected
    assert set(found.finite) == set(found.values)


def test_an_insert_is_told_from_the_uniform_region_as_well_as_white_noise_allows() -> None:
    draw = np.random.default_rng(3)
    insert = (18.0, -5.0, 6.0)
    disc = np.hypot(GRID.x - insert[0], GRID.y[:, None] - insert[1]) < insert[2] / 2
    images = from_hu(torch.from_numpy(5.0 * disc + draw.normal(0, NOISE_HU, (100, 96, 96))))
    measure = {"grid": GRID, "uniform": UNIFORM, "insert": insert, "generator": np.random.default_rng(0)}
    found = measure_phantom(images, **measure).values
    ideal = 5.0 * math.sqrt(disc.sum()) / NOISE_HU  # of an observer that knows the disc and the noise
    assert 0.6 * ideal < found["d_prime_cho"] < 1.1 * ideal
    assert found["d_prime_cho_low"] < found["d_prime_cho"] < found["d_prime_cho_high"]
    without = measure_phantom(images - from_hu(5.0 * torch.from_numpy(disc)) + 1, **measure).values
    assert without["d_prime_cho_low"] < 0.1 * ideal
    with pytest.raises(ValueError, match="at least 40 pairs"):
        measure_phantom(images[:20], **measure)


def test_the_region_is_where_it_was_said(phantom) -> None:
    """Noise in the region alone is found there, and nowhere else."""
    patches, size = patches_in_square(GRID, center=UNIFORM[:2], side=UNIFORM[2], size=16)
    assert (len(patches), size) == (4, 16)
    quiet = phantom.mean(0).expand(4, -1, -1).clone()
    rows, cols = (np.abs(axis - middle) < 8 for axis, middle in ((GRID.y, UNIFORM[1]), (GRID.x, UNIFORM[0])))
    quiet[:, np.ix_(rows, cols)[0], np.ix_(rows, cols)[1]] += torch.arange(4.0)[:, None, None] / 100
    assert measure_phantom(quiet, GRID, uniform=UNIFORM).values["noise_hu"] == pytest.approx(10 * math.sqrt(5 / 3))
    assert measure_phantom(quiet, GRID, uniform=(-2.0, 11.5, 8.0)).values["noise_hu"] == pytest.approx(0, abs=1e-3)


def test_what_cannot_be_measured_is_refused(phantom) -> None:
    with pytest.raises(ValueError, match="needs the transfer of a disc"):
        measure_phantom(phantom, GRID, uniform=UNIFORM, lesion=(20.0, 8.0))
    with pytest.raises(ValueError, match=r"at least 8 pixels \(4 mm\), got 3 mm"):
        measure_phantom(phantom, GRID, uniform=(0.0, 0.0, 3.0))
    with pytest.raises(ValueError, match=r"must be in the image, of 96 x 96 .* got one of 10 mm around \(-20, 0\) mm"):
        measure_phantom(phantom, GRID, uniform=(-20.0, 0.0, 10.0))
    with pytest.raises(ValueError, match="stronger insert"):
        measure_phantom(phantom, GRID, uniform=UNIFORM, disc=(-2.0, -5.0, 10.0))
    power = noise_power_of_repeats(phantom, spacing=GRID.spacing)
    for contrast, diameter in ((0.0, 8.0), (math.nan, 8.0), (20.0, 0.0)):
        with pytest.raises(ValueError, match="A disc has a contrast in HU and a diameter in mm"):
            matched_filter_d_prime(power, sharp, contrast_hu=contrast, diameter=diameter)
