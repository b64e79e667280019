import math

import numpy as np
import pytest

from pnpct.evaluation import DiscTask, EyeFilter, NoisePower, spectral_detectability


def white(variance: float, *, spacing: float = 0.5, size: int = 128) -> NoisePower:
    frequencies = np.fft.fftshift(np.fft.fftfreq(size, spacing))
    return NoisePower(frequencies, np.full((size, size), variance * spacing**2))


def perfect(frequencies: np.ndarray) -> np.ndarray:
    return np.ones_like(frequencies)


def test_the_eye_has_its_peak_at_one() -> None:
    for eye in (EyeFilter(), EyeFilter(zoom=3.0), EyeFilter(decay=3.22)):
        values = eye(np.linspace(0, 5, 20001))
        assert values.max() == pytest.approx(1.0, abs=1e-4)
        assert values[0] == 0.0


def test_zoom_moves_the_eye_to_higher_frequencies_of_the_patient() -> None:
    f = np.linspace(0.01, 2, 50)
    assert EyeFilter(zoom=2.0)(2 * f) == pytest.approx(EyeFilter()(f), rel=1e-12)
    assert EyeFilter(distance=1000.0)(f / 2) == pytest.approx(EyeFilter()(f), rel=1e-12)


def test_the_task_of_a_disc_is_its_fourier_transform() -> None:
    x = (np.arange(400) - 199.5) * 0.05
    disc = 30.0 * (np.hypot(x[:, None], x) < 3.0)
    task = DiscTask(diameter=6.0, contrast_hu=30.0)
    for f in (0.0, 0.1, 0.25):
        by_sum = (disc * np.cos(2 * np.pi * f * x)).sum() * 0.05**2
        assert task(np.array([f]))[0] == pytest.approx(by_sum, abs=3.0)


def test_a_gaussian_in_white_noise_has_its_analytic_index() -> None:
    sigma, contrast, variance = 2.0, 10.0, 400.0
    index = spectral_detectability(
        lambda f: contrast * 2 * np.pi * sigma**2 * np.exp(-2 * np.pi**2 * sigma**2 * f**2), perfect, white(variance)
    )
    assert index == pytest.approx(contrast * math.sqrt(math.pi) * sigma / math.sqrt(variance) / 0.5, rel=1e-6)


def test_the_index_goes_with_contrast_and_the_root_of_dose() -> None:
    task = DiscTask(diameter=6.0, contrast_hu=10.0)
    index = spectral_detectability(task, perfect, white(400.0), eye=EyeFilter())
    twice = DiscTask(diameter=6.0, contrast_hu=20.0)
    assert spectral_detectability(twice, perfect, white(400.0), eye=EyeFilter()) == pytest.approx(2 * index)
    assert spectral_detectability(task, perfect, white(100.0), eye=EyeFilter()) == pytest.approx(2 * index)


def test_a_blur_of_signal_and_noise_raises_the_index_which_is_why_it_is_no_evidence() -> None:
    def blur(f: np.ndarray) -> np.ndarray:
        return np.exp(-2 * np.pi**2 * 0.8**2 * f**2)

    task, noise = DiscTask(diameter=6.0, contrast_hu=10.0), white(400.0)
    # Noise of FBP rises with frequency.
    fbp = NoisePower(noise.frequencies, noise.power * noise.radius)
    blurred = NoisePower(fbp.frequencies, fbp.power * blur(fbp.radius) ** 2)
    assert spectral_detectability(task, blur, blurred) > 1.05 * spectral_detectability(task, perfect, fbp)


def test_impossible_readers_and_tasks_are_refused() -> None:
    with pytest.raises(ValueError, match="zoom"):
        EyeFilter(zoom=0.0)
    with pytest.raises(ValueError, match="positive diameter"):
        DiscTask(diameter=-1.0, contrast_hu=3.0)
    with pytest.raises(ValueError, match="noise"):
        spectral_detectability(DiscTask(diameter=6.0, contrast_hu=10.0), perfect, white(0.0))
