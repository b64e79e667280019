import numpy as np
import pytest
import torch
from scipy.stats import wasserstein_distance

from pnpct.evaluation import earth_movers_distance, gray_histogram, repeat_scan_floor
from pnpct.evaluation.texture.histogram import gray_levels
from pnpct.units import from_hu


def noisy(spread_hu: float, seed: int) -> torch.Tensor:
    return from_hu(30 + spread_hu * torch.randn(64, 64, generator=torch.Generator().manual_seed(seed)))


def test_levels_are_equal_bins_of_the_window_and_its_top_is_the_last() -> None:
    levels = gray_levels(np.array([-500.0, -120.0, -119.0, -118.8, 30.0, 179.9, 180.0, 900.0]))
    assert levels.tolist() == [0, 0, 0, 1, 128, 255, 255, 255]


def test_the_distance_is_zero_to_itself_and_symmetric() -> None:
    a, b = noisy(20, 1), noisy(40, 2)
    assert earth_movers_distance(a, a) == 0.0
    assert earth_movers_distance(a, b) == earth_movers_distance(b, a) > 0


@pytest.mark.parametrize("bins", [1, 7, 40])
def test_a_shift_by_k_bins_is_k_over_255(bins: int) -> None:
    image = from_hu(-120 + 300 / 256 * (torch.randint(0, 200, (32, 32), dtype=torch.float64) + 0.5))
    assert earth_movers_distance(image + bins * 300 / 256 / 1000, image) == pytest.approx(bins / 255, abs=1e-12)


def test_the_distance_is_the_area_between_the_distribution_functions() -> None:
    a, b = noisy(20, 3), noisy(40, 4)
    area = np.abs(np.cumsum(gray_histogram(a)) - np.cumsum(gray_histogram(b))).sum() / 255
    assert earth_movers_distance(a, b) == pytest.approx(area, abs=1e-12)
    levels = [gray_levels(1000 * (one.double().numpy() - 1)).ravel() / 255 for one in (a, b)]
    assert earth_movers_distance(a, b) == pytest.approx(wasserstein_distance(*levels), abs=1e-6)


def test_repeats_are_nearer_to_each_other_than_a_noisier_scan() -> None:
    repeats = torch.stack([noisy(20, seed) for seed in (5, 6, 7)])
    floor = repeat_scan_floor(repeats)
    assert 0 < floor < 0.01 < earth_movers_distance(noisy(40, 8), repeats[0])
    assert repeat_scan_floor(repeats[:2]) == earth_movers_distance(repeats[0], repeats[1])


def test_only_what_is_in_the_mask_counts() -> None:
    image, reference = torch.ones(8, 8), torch.ones(8, 8)
    image[:4] = 0.0
    mask = torch.zeros(8, 8, dtype=torch.bool)
    mask[4:] = True
    assert earth_movers_distance(image, reference, mask=mask) == 0.0
    assert earth_movers_distance(image, reference) > 0.1


def test_what_cannot_be_compared_is_refused() -> None:
    image = torch.ones(4, 4)
    with pytest.raises(ValueError, match="one shape"):
        earth_movers_distance(image, torch.ones(4, 5))
    with pytest.raises(ValueError, match="at least one pixel"):
        gray_histogram(image, mask=torch.zeros(4, 4, dtype=torch.bool))
    with pytest.raises(ValueError, match="shape of its image"):
        gray_histogram(image, mask=torch.ones(4, 5, dtype=torch.bool))
    with pytest.raises(ValueError, match="window"):
        gray_histogram(image, window=(10.0, 10.0))
    with pytest.raises(ValueError, match="gray levels"):
        gray_histogram(image, levels=300)
    with pytest.raises(ValueError, match="two repeats"):
        repeat_scan_floor(image[None])
