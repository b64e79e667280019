import math

import pytest
import torch
from skimage.metrics import structural_similarity

from pnpct.training.local_statistics import (
    gaussian_taps,
    local_entropy,
    local_mean,
    ssim_map,
    uniform_taps,
)


@pytest.fixture
def pair(generator: torch.Generator) -> torch.Tensor:
    common = 1 + 0.05 * torch.randn(40, 44, generator=generator, dtype=torch.float64)
    return common + 0.03 * torch.randn(2, 40, 44, generator=generator, dtype=torch.float64)


@pytest.mark.parametrize("data_range_hu", [400.0, 2000.0])
@pytest.mark.parametrize(
    ("taps", "options"),
    [
        (gaussian_taps(), {"gaussian_weights": True, "sigma": 1.5}),
        (uniform_taps(7), {"win_size": 7}),
    ],
    ids=["gaussian", "uniform"],
)
def test_scikit_image_agrees_about_structural_similarity(
    taps: torch.Tensor, options: dict[str, object], data_range_hu: float, pair: torch.Tensor
) -> None:
    a, b = pair
    mean, similarity = structural_similarity(
        a.numpy(), b.numpy(), data_range=data_range_hu / 1000, use_sample_covariance=False, full=True, **options
    )
    reach = len(taps) // 2
    expected = torch.from_numpy(similarity)[reach:-reach, reach:-reach]
    in_single = ssim_map(a.float(), b.float(), data_range_hu=data_range_hu, taps=taps)
    torch.testing.assert_close(ssim_map(a, b, data_range_hu=data_range_hu, taps=taps), expected, rtol=0, atol=1e-10)
    torch.testing.assert_close(in_single, expected.float(), rtol=0, atol=1e-5)
    assert in_single.mean().item() == pytest.approx(mean, abs=1e-5)


def test_a_mean_counts_the_pixels_of_the_window(pair: torch.Tensor) -> None:
    mean = local_mean(pair, uniform_taps(5))
    assert mean.shape == (2, 36, 40)
    assert mean[1, 3, 4].item() == pytest.approx(pair[1, 3:8, 4:9].mean().item())


def test_the_weights_of_a_window_add_up_to_1_and_are_those_of_a_gaussian() -> None:
    taps = gaussian_taps(2.0, side=7)
    assert taps.sum().item() == pytest.approx(1)
    assert (taps[4] / taps[3]).item() == pytest.approx(math.exp(-1 / 8))
    assert uniform_taps(9).sum().item() == pytest.approx(1)


def test_mixed_precision_does_not_reach_the_statistics(pair: torch.Tensor) -> None:
    a, b = pair.float()
    with torch.autocast("cpu", torch.bfloat16):
        similarity, entropy = ssim_map(a, b, data_range_hu=400.0), local_entropy(a)
    assert torch.equal(similarity, ssim_map(a, b, data_range_hu=400.0))
    assert torch.equal(entropy, local_entropy(a))


@pytest.mark.parametrize("noise_hu", [5.0, 15.0, 30.0])
def test_the_entropy_of_normal_noise_is_that_of_its_distribution(noise_hu: float, generator: torch.Generator) -> None:
    image = 1.04 + noise_hu / 1000 * torch.randn(120, 120, generator=generator)
    expected = 0.5 * math.log(2 * math.pi * math.e * noise_hu**2)
    # A window of 81 samples misses some of it.
    assert local_entropy(image).mean().item() == pytest.approx(expected, abs=0.3)


def test_the_entropy_rises_with_the_logarithm_of_the_noise(generator: torch.Generator) -> None:
    noise = 0.01 * torch.randn(30, 30, generator=generator, dtype=torch.float64)
    rise = local_entropy(1 + 2 * noise, floor_hu=1e-6) - local_entropy(1 + noise, floor_hu=1e-6)
    torch.testing.assert_close(rise, torch.full_like(rise, math.log(2)))


def test_a_flat_image_has_the_entropy_of_the_floor() -> None:
    flat = torch.full((20, 20), 1.5, dtype=torch.float64)
    floor = 0.5 * math.log(2 * math.pi * math.e * 2.0**2)
    assert local_entropy(flat, floor_hu=2.0).mean().item() == pytest.approx(floor)


def test_entropies_of_a_batch_are_those_of_its_images(generator: torch.Generator) -> None:
    images = 1 + 0.01 * torch.randn(2, 2, 20, 21, generator=generator)
    torch.testing.assert_close(local_entropy(images)[1, 0], local_entropy(images[1, 0]))


def test_images_smaller_than_the_window_are_refused() -> None:
    with pytest.raises(ValueError, match="window of 9 pixels"):
        local_entropy(torch.ones(8, 30))
