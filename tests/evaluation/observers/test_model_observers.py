import math
from functools import partial

import numpy as np
import pytest
import torch
from low_dose_slice import disc_spectrum
from scipy.ndimage import gaussian_filter
from scipy.special import ndtr

from pnpct.evaluation import (
    Detectability,
    EyeFilter,
    channelised_hotelling,
    laguerre_gauss_channels,
    matched_filter,
    noise_power_of_repeats,
)

SPACING = 0.5
SIDE = 32
X = (np.arange(SIDE) - (SIDE - 1) / 2) * SPACING
RADIUS = np.hypot(X[:, None], X)
SIGMA = 1.5
DIAMETER = 1.5 * SIGMA * math.sqrt(2 * math.pi)
"""Of the lesion for which the first channel is the Gaussian of SIGMA."""
GAUSSIAN = np.exp(-0.5 * (RADIUS / SIGMA) ** 2)
NOISE_HU = 20.0


def pairs(signal_hu: np.ndarray, *, count: int = 300, blur: float = 0.0, seed: int = 1) -> list[torch.Tensor]:
    white = np.random.default_rng(seed).normal(scale=NOISE_HU, size=(2, count, SIDE, SIDE))
    white[0] += signal_hu
    return [torch.from_numpy(1 + one / 1000) for one in gaussian_filter(white, (0, 0, blur, blur), mode="wrap")]


def amplitude(d_prime: float, shape: np.ndarray) -> float:
    """Contrast in HU that gives a d′ in the white noise."""
    return d_prime * NOISE_HU / math.sqrt((shape**2).sum())


def hotelling(present: torch.Tensor, absent: torch.Tensor, **options) -> Detectability:
    return channelised_hotelling(
        present, absent, spacing=SPACING, diameter=DIAMETER, generator=np.random.default_rng(2),
        **{"resamples": 100, **options},
    )  # fmt: skip


def test_channels_are_orthonormal() -> None:
    u = laguerre_gauss_channels(129, spacing=0.25, diameter=9.0).reshape(5, -1)
    assert u @ u.T * 0.25**2 == pytest.approx(np.eye(5), abs=1e-6)


def test_a_gaussian_in_white_noise_has_its_analytic_d_prime() -> None:
    centred = GAUSSIAN - GAUSSIAN.mean()
    found = hotelling(*pairs(amplitude(2.0, centred) * GAUSSIAN, count=1000))
    error = found.d_prime.standard_error
    assert found.d_prime.estimate == pytest.approx(2.0, abs=3 * error)
    assert error < 0.1
    assert found.auc == pytest.approx(ndtr(2 / math.sqrt(2)), abs=0.02)
    assert found.pairs == 1000


def test_without_a_signal_nothing_is_found() -> None:
    found = hotelling(*pairs(np.zeros((SIDE, SIDE))))
    assert found.d_prime.estimate == pytest.approx(0.0, abs=3 * found.d_prime.standard_error)
    assert found.auc == pytest.approx(0.5, abs=0.06)


def test_an_offset_of_the_whole_patch_is_no_signal() -> None:
    found = hotelling(*pairs(np.full((SIDE, SIDE), 50.0)))
    assert abs(found.d_prime.estimate) < 3 * found.d_prime.standard_error


def test_a_blur_neither_helps_nor_hurts_the_hotelling_observer() -> None:
    narrow = np.exp(-0.5 * (RADIUS / 0.8) ** 2)
    signal = amplitude(2.0, narrow) * narrow
    plain, blurred = hotelling(*pairs(signal)), hotelling(*pairs(signal, blur=1.0))
    assert blurred.d_prime.estimate == pytest.approx(plain.d_prime.estimate, rel=0.12)


def test_the_bootstrap_error_is_the_spread_over_repeated_studies() -> None:
    signal = amplitude(1.5, GAUSSIAN) * GAUSSIAN
    studies = [hotelling(*pairs(signal, count=60, seed=seed), resamples=25, splits=4) for seed in range(18)]
    spread = np.std([study.d_prime.estimate for study in studies], ddof=1)
    assert np.mean([study.d_prime.standard_error for study in studies]) == pytest.approx(spread, rel=0.4)


def test_a_known_signal_in_white_noise_has_its_analytic_d_prime() -> None:
    signal = amplitude(2.0, GAUSSIAN) * GAUSSIAN
    present, absent = pairs(signal, count=1000)
    found = matched_filter(
        present, absent, spacing=SPACING, signal=torch.from_numpy(signal), generator=np.random.default_rng(3)
    )
    assert found.d_prime.estimate == pytest.approx(2.0, abs=3 * found.d_prime.standard_error)
    assert found.d_prime.standard_error == pytest.approx(math.sqrt((2 + 2.0**2 / 4) / 1000), rel=0.2)
    assert found.auc == pytest.approx(ndtr(2 / math.sqrt(2)), abs=0.02)


@pytest.mark.parametrize("eye", [None, EyeFilter(zoom=2.0)])
def test_the_template_on_images_agrees_with_the_spectra(eye: EyeFilter | None) -> None:
    """AAPM Task Group 233: d′² = [∫∫ |W|² TTF² E²]² / ∫∫ |W|² TTF² E⁴ NPS, within three standard errors."""
    sigma = 0.7

    def task(f: np.ndarray) -> np.ndarray:
        return 6.0 * disc_spectrum(5.0, f)

    def blur(f: np.ndarray) -> np.ndarray:
        return np.exp(-2 * np.pi**2 * sigma**2 * f**2)

    along = np.fft.fftfreq(SIDE, SPACING)
    spectrum = task(np.hypot(along[:, None], along)) / SPACING**2
    disc = np.fft.fftshift(np.fft.ifft2(spectrum * np.exp(1j * np.pi * (along[:, None] + along) * SPACING))).real
    present, absent = pairs(disc, count=600, blur=sigma / SPACING)
    blurred = gaussian_filter(disc, sigma / SPACING, mode="wrap")
    found = matched_filter(
        present, absent, spacing=SPACING, eye=eye, signal=torch.from_numpy(blurred), generator=np.random.default_rng(4)
    )
    noise = noise_power_of_repeats(absent, spacing=SPACING, size=SIDE)
    seen, squared_eye = (task(noise.radius) * blur(noise.radius)) ** 2, 1.0 if eye is None else eye(noise.radius) ** 2
    expected = (seen * squared_eye).sum() * noise.step / math.sqrt((seen * squared_eye**2 * noise.power).sum())
    assert found.d_prime.estimate == pytest.approx(expected, abs=3 * found.d_prime.standard_error)


def test_the_noise_of_an_estimated_template_costs_what_theory_says() -> None:
    present, absent = pairs(amplitude(3.0, GAUSSIAN) * GAUSSIAN, count=400)
    estimated = present[:200].mean(0) - absent[:200].mean(0)
    found = matched_filter(
        present[200:], absent[200:], signal=estimated, spacing=SPACING, generator=np.random.default_rng(5)
    )
    # A template from 200 pairs carries the noise of 2/200 images in each of its pixels: w = s + n.
    expected = 3.0 / math.sqrt(1 + SIDE**2 * 2 / 200 / 3.0**2)
    assert found.d_prime.estimate == pytest.approx(expected, abs=3 * found.d_prime.standard_error)
    assert found.d_prime.standard_error < 0.15


def test_one_seed_gives_one_result() -> None:
    present, absent = pairs(GAUSSIAN, count=40)
    assert hotelling(present, absent) == hotelling(present, absent)


def test_what_cannot_be_judged_is_refused() -> None:
    present, absent = pairs(GAUSSIAN, count=40)
    find = partial(
        matched_filter, signal=torch.from_numpy(GAUSSIAN), spacing=SPACING, generator=np.random.default_rng(1)
    )
    with pytest.raises(ValueError, match="at least 40 pairs"):
        hotelling(present[:39], absent[:39])
    with pytest.raises(ValueError, match="independent noise"):
        hotelling(present[:1].repeat(40, 1, 1), absent)
    with pytest.raises(ValueError, match="Two resamples"):
        hotelling(present, absent, resamples=1)
    with pytest.raises(ValueError, match="at least 8 pairs"):
        find(present[:4], absent[:4])
    with pytest.raises(ValueError, match="positive length"):
        find(present, absent, spacing=-1.0)
    with pytest.raises(ValueError, match="not 0 everywhere"):
        find(present, absent, signal=torch.zeros(SIDE, SIDE))
    with pytest.raises(ValueError, match="above 0"):
        laguerre_gauss_channels(8, spacing=0.0, diameter=3.0)
