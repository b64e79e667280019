import numpy as np
import pytest
import torch
from scipy.ndimage import gaussian_filter

from pnpct.evaluation import NoisePower, Patch, noise_power_of_one, noise_power_of_repeats

SPACING = 0.7


def noise(repeats: int, *, blur: float = 0.0, size: int = 128, seed: int = 1) -> np.ndarray:
    """White noise of 20 HU, blurred across the borders as on a torus."""
    white = np.random.default_rng(seed).normal(scale=20.0, size=(repeats, size, size))
    return gaussian_filter(white, (0, blur, blur), mode="wrap")


def image(noise_hu: np.ndarray) -> torch.Tensor:
    return torch.from_numpy(1 + noise_hu / 1000)


@pytest.mark.parametrize("blur", [0.0, 1.2])
def test_the_integral_is_the_variance(blur: float) -> None:
    """Parseval, within 2 %."""
    hu = noise(20, blur=blur)
    measured = noise_power_of_repeats(image(hu), spacing=SPACING)
    assert measured.variance == pytest.approx(hu.var(axis=0, ddof=1).mean(), rel=1e-9)
    assert measured.variance == pytest.approx(np.mean(noise(1, blur=blur, size=2000) ** 2), rel=0.02)


def test_white_noise_is_flat_at_its_variance_times_the_area_of_a_pixel() -> None:
    radial = noise_power_of_repeats(image(noise(64)), spacing=SPACING).radial()
    assert radial.power[3:] == pytest.approx(400 * SPACING**2, rel=0.06)
    nyquist = 0.5 / SPACING
    assert radial.frequencies[-1] == pytest.approx(nyquist)
    assert radial.mean_frequency == pytest.approx(nyquist / 2, rel=0.02)


def test_blurred_noise_has_the_squared_transfer_of_the_blur() -> None:
    sigma = 1.5
    radial = noise_power_of_repeats(image(noise(64, blur=sigma)), spacing=SPACING).radial()
    f = radial.frequencies[2:16]
    expected = 400 * SPACING**2 * np.exp(-4 * np.pi**2 * (sigma * SPACING) ** 2 * f**2)
    assert radial.power[2:16] == pytest.approx(expected, rel=0.1, abs=2.0)
    assert radial.mean_frequency < 0.25 / SPACING
    assert radial.peak_frequency < 0.2 / SPACING


def test_two_repeats_are_the_difference_method() -> None:
    hu = noise(2, size=64)
    measured = noise_power_of_repeats(image(hu), spacing=SPACING)
    difference = np.abs(np.fft.fftshift(np.fft.fft2(hu[0] - hu[1]))) ** 2 / 2 * SPACING**2 / 64**2
    assert measured.power == pytest.approx(difference, rel=1e-6, abs=1e-6 * difference.max())


def test_what_all_repeats_share_is_no_noise() -> None:
    hu, anatomy = noise(4), 500 * gaussian_filter(noise(1, seed=9)[0], 3)
    with_anatomy = noise_power_of_repeats(image(hu + anatomy), spacing=SPACING)
    assert with_anatomy.power == pytest.approx(noise_power_of_repeats(image(hu), spacing=SPACING).power, rel=1e-6)


def test_one_image_loses_its_cupping_and_keeps_its_noise() -> None:
    hu = noise(1, size=512)[0]
    y, x = np.mgrid[:512, :512] / 512
    cupped = noise_power_of_one(image(hu + 80 * x**2 - 60 * x * y + 30 * y), spacing=SPACING)
    plain = noise_power_of_one(image(hu), spacing=SPACING)
    assert cupped.power == pytest.approx(plain.power, rel=1e-6, abs=1e-6)
    assert plain.variance == pytest.approx(400.0, rel=0.02)


def test_only_the_chosen_patches_count() -> None:
    hu = noise(8)
    hu[:, :, 64:] *= 5
    quiet = noise_power_of_repeats(image(hu), spacing=SPACING, patches=[Patch(0, 0), Patch(64, 0)])
    assert quiet.variance == pytest.approx(400.0, rel=0.05)


def test_rows_and_columns_keep_their_places() -> None:
    waves = np.cos(2 * np.pi * 8 * np.arange(64) / 64)[:, None] * np.ones(64)
    measured = noise_power_of_repeats(image(np.stack([waves, -waves])), spacing=SPACING)
    row, col = np.unravel_index(np.argmax(measured.power), measured.power.shape)
    assert abs(measured.frequencies[row]) == pytest.approx(8 / (64 * SPACING))
    assert measured.frequencies[col] == 0.0


def test_an_image_without_noise_has_no_mean_frequency() -> None:
    assert np.isnan(NoisePower(np.array([-0.5, 0.0]), np.zeros((2, 2))).radial().mean_frequency)


def test_what_has_no_spectrum_is_refused() -> None:
    with pytest.raises(ValueError, match="Two repeats"):
        noise_power_of_repeats(torch.ones(1, 64, 64), spacing=1.0)
    with pytest.raises(ValueError, match="positive length"):
        noise_power_of_repeats(torch.ones(2, 64, 64), spacing=0.0)
    with pytest.raises(ValueError, match="must hold a patch"):
        noise_power_of_one(torch.ones(32, 64), spacing=1.0)
    with pytest.raises(ValueError, match="2 x 2"):
        noise_power_of_repeats(torch.ones(2, 64, 64), spacing=1.0, size=1)
    with pytest.raises(ValueError, match="3 x 3"):
        noise_power_of_one(torch.ones(64, 64), spacing=1.0, size=2)
