import math

import numpy as np
import pytest
import torch
from scipy.ndimage import gaussian_filter

from pnpct.evaluation import TaskTransfer, task_transfer
from pnpct.geometry import ImageGrid

GRID = ImageGrid(96, 96, spacing=0.5, center=(20.0, -10.0))
CENTER = (20.13, -10.21)
RADIUS = 10.0


def disc(sigma: float, *, contrast_hu: float = 100.0, fine: int = 9) -> np.ndarray:
    """A disc after a Gaussian blur of sigma mm, sampled (not averaged) at the pixel centres of the grid."""
    grid = ImageGrid(96 * fine, 96 * fine, spacing=GRID.spacing / fine, center=GRID.center)
    inside = np.hypot(grid.x[None, :] - CENTER[0], grid.y[:, None] - CENTER[1]) < RADIUS
    blurred = gaussian_filter(inside.astype(float), sigma / grid.spacing)
    return 1 + contrast_hu / 1000 * blurred[fine // 2 :: fine, fine // 2 :: fine]


def measure(image: np.ndarray, **options) -> TaskTransfer:
    stack = torch.from_numpy(image if image.ndim == 3 else image[None])
    return task_transfer(stack, grid=GRID, center=(20.0, -10.0), radius=RADIUS, **options)


@pytest.mark.parametrize("sigma", [0.35, 0.6, 1.0])
def test_a_gaussian_blur_has_its_transfer(sigma: float) -> None:
    """The transfer is exp(−2π²σ²f²) within 0.03 down to a tenth."""
    measured = measure(disc(sigma))
    expected = np.exp(-2 * np.pi**2 * sigma**2 * measured.frequencies**2)
    upto = expected >= 0.1
    assert measured.transfer[upto] == pytest.approx(expected[upto], abs=0.03)
    assert measured.f50 == pytest.approx(math.sqrt(math.log(2) / 2) / (math.pi * sigma), rel=0.03)
    assert measured.f10 == pytest.approx(math.sqrt(math.log(10) / 2) / (math.pi * sigma), rel=0.03)


def test_the_disc_is_found_where_it_is() -> None:
    measured = measure(disc(0.5))
    assert measured.center == pytest.approx(CENTER, abs=0.02)
    assert measured.contrast_hu == pytest.approx(100.0, rel=1e-3)


def test_a_dark_disc_is_as_sharp_as_a_bright_one() -> None:
    bright, dark = measure(disc(0.5)), measure(disc(0.5, contrast_hu=-100.0))
    assert dark.transfer == pytest.approx(bright.transfer, abs=1e-6)
    assert dark.contrast_hu == pytest.approx(-100.0, rel=1e-3)


def test_averaging_repeats_brings_out_the_edge() -> None:
    noise = np.random.default_rng(1).normal(scale=0.02, size=(64, 96, 96))
    measured = measure(disc(0.6) + noise)
    assert measured.contrast_to_noise == pytest.approx(5 * 8, rel=0.1)
    assert measured.f50 == pytest.approx(math.sqrt(math.log(2) / 2) / (math.pi * 0.6), rel=0.05)


def test_too_little_contrast_for_the_noise_is_refused() -> None:
    noise = np.random.default_rng(1).normal(scale=0.02, size=(4, 96, 96))
    with pytest.raises(ValueError, match="average more scans"):
        measure(disc(0.6) + noise)
    with pytest.raises(ValueError, match="stronger insert"):
        measure(np.ones((96, 96)), least_contrast_to_noise=0.0)


def test_as_a_function_it_is_zero_beyond_its_frequencies() -> None:
    measured = measure(disc(0.5))
    assert measured(np.array([0.0, 100.0])).tolist() == [1.0, 0.0]


def test_a_transfer_that_does_not_fall_has_no_f10() -> None:
    flat = TaskTransfer(np.array([0.0, 1.0]), np.array([1.0, 0.4]), (0.0, 0.0), 1.0, 1.0)
    assert flat.f50 == pytest.approx(5 / 6)
    assert math.isinf(flat.f10)


def test_a_disc_that_is_too_small_or_near_the_border_is_refused() -> None:
    image = torch.from_numpy(disc(0.5)[None])
    with pytest.raises(ValueError, match="at least 4 pixels"):
        task_transfer(image, grid=GRID, center=CENTER, radius=1.0)
    with pytest.raises(ValueError, match="inside the image"):
        task_transfer(image, grid=GRID, center=(30.0, -10.0), radius=RADIUS)
    with pytest.raises(ValueError, match="pixels was expected"):
        task_transfer(image[:, 1:], grid=GRID, center=CENTER, radius=RADIUS)
