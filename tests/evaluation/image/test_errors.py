import math
from functools import partial

import pytest
import torch
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

from pnpct.evaluation import METRICS, WINDOWS, bias_hu, evaluate, psnr, rmse_hu, soft_tissue_mask, ssim

ABDOMEN_PSNR = partial(psnr, window=WINDOWS["abdomen"])
ABDOMEN_SSIM = partial(ssim, window=WINDOWS["abdomen"])


@pytest.fixture
def pair(disk: torch.Tensor, generator: torch.Generator) -> tuple[torch.Tensor, torch.Tensor]:
    """A noisy image that is 10 HU too high, and what it should be."""
    return disk + 0.01 + 0.05 * torch.randn(disk.shape, generator=generator), disk


def test_bias_and_rmse_of_a_shift_are_the_shift(disk: torch.Tensor) -> None:
    assert bias_hu(disk - 0.02, disk) == pytest.approx(-20.0, abs=1e-3)
    assert rmse_hu(disk - 0.02, disk) == pytest.approx(20.0, abs=1e-3)


def test_rmse_is_the_square_sum_of_bias_and_spread(pair: tuple[torch.Tensor, torch.Tensor]) -> None:
    image, reference = pair
    spread = 1000 * (image - reference).double().std(correction=0).item()
    assert rmse_hu(image, reference) == pytest.approx(math.hypot(bias_hu(image, reference), spread), rel=1e-9)


def test_only_what_is_in_the_mask_counts(disk: torch.Tensor) -> None:
    mask = torch.zeros(disk.shape, dtype=torch.bool)
    mask[:10] = True
    image = disk.clone()
    image[10:] += 1.0
    assert rmse_hu(image, disk, mask=mask) == 0.0
    assert bias_hu(image, disk, mask=~mask) == pytest.approx(1000.0, rel=1e-6)


@pytest.mark.parametrize("window", WINDOWS.values())
def test_scikit_image_agrees_on_the_windowed_images(
    pair: tuple[torch.Tensor, torch.Tensor], window: tuple[float, float]
) -> None:
    image, reference = pair
    width = window[1] - window[0]
    a, b = ((1000 * (one.double() - 1)).clamp(*window).numpy() - window[0] for one in pair)
    assert psnr(image, reference, window=window) == pytest.approx(
        peak_signal_noise_ratio(b, a, data_range=width), abs=1e-6
    )
    expected = structural_similarity(
        b, a, data_range=width, gaussian_weights=True, sigma=1.5, use_sample_covariance=False
    )
    assert ssim(image, reference, window=window) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("metric", [psnr, ssim])
def test_the_range_of_the_data_must_be_stated(metric: object, disk: torch.Tensor) -> None:
    with pytest.raises(TypeError, match="window"):
        metric(disk, disk)


def test_a_mask_averages_the_map_of_similarity(pair: tuple[torch.Tensor, torch.Tensor]) -> None:
    image, reference = pair
    window = WINDOWS["abdomen"]
    a, b = ((1000 * (one.double() - 1)).clamp(*window).numpy() + 160 for one in pair)
    _, whole = structural_similarity(
        b, a, data_range=400, gaussian_weights=True, sigma=1.5, use_sample_covariance=False, full=True
    )
    mask = torch.zeros(reference.shape, dtype=torch.bool)
    mask[:14, 3:20] = True
    inside = mask.clone()
    inside[:5] = inside[:, :5] = False
    assert ssim(image, reference, window=window, mask=mask) == pytest.approx(whole[inside.numpy()].mean(), abs=1e-6)
    error = ((a - b)[mask.numpy()] ** 2).mean()
    assert psnr(image, reference, window=window, mask=mask) == pytest.approx(10 * math.log10(400**2 / error), abs=1e-6)
    with pytest.raises(ValueError, match="mask is empty"):
        ssim(image, reference, window=window, mask=mask & ~inside)


def test_equal_images_have_no_error(disk: torch.Tensor) -> None:
    assert rmse_hu(disk, disk) == 0.0
    assert ABDOMEN_PSNR(disk, disk) == math.inf
    assert ABDOMEN_SSIM(disk, disk) == pytest.approx(1.0, abs=1e-12)


def test_what_is_outside_the_window_cannot_be_seen(disk: torch.Tensor) -> None:
    air = disk == 0
    image = torch.where(air, torch.tensor(0.3), disk)
    assert rmse_hu(image, disk) > 100
    assert ABDOMEN_PSNR(image, disk) == math.inf


def test_twice_the_noise_costs_6_decibels(disk: torch.Tensor, generator: torch.Generator) -> None:
    # Water has 160 and 240 HU of the window on either side: nothing is clipped.
    water = torch.ones_like(disk)
    noise = 0.02 * torch.randn(disk.shape, generator=generator)
    gain = ABDOMEN_PSNR(water + noise, water) - ABDOMEN_PSNR(water + 2 * noise, water)
    assert gain == pytest.approx(20 * math.log10(2), abs=1e-4)


def test_a_batch_of_equal_slices_scores_as_one(pair: tuple[torch.Tensor, torch.Tensor]) -> None:
    image, reference = pair
    batch = evaluate(image.expand(2, 3, -1, -1), reference.expand(2, 3, -1, -1))
    one = evaluate(image, reference)
    assert list(batch) == list(METRICS)
    assert batch == pytest.approx(one, rel=1e-9)


def test_evaluate_counts_body_and_soft_tissue_apart(disk: torch.Tensor) -> None:
    image = torch.where(disk == 0, disk + 0.1, disk + 0.01)
    values = evaluate(image, disk)
    assert values["bias_hu"] > 20
    assert values["soft_tissue_bias_hu"] == pytest.approx(10.0, abs=1e-3)
    assert values["body_rmse_hu"] == pytest.approx(10.0, abs=1e-3)


def test_ratios_and_similarities_leave_air_out(disk: torch.Tensor) -> None:
    streaks = torch.where(disk == 0, disk + 0.95, disk)
    values = evaluate(streaks, disk)
    assert {values["psnr_40_400"], values["psnr_30_300"]} == {math.inf}
    assert values["ssim_40_400"] > ABDOMEN_SSIM(streaks, disk)
    assert psnr(streaks, disk, window=WINDOWS["abdomen"]) < 20


def test_evaluate_takes_other_metrics(disk: torch.Tensor) -> None:
    def largest(image: torch.Tensor, reference: torch.Tensor) -> float:
        return float((image - reference).abs().max())

    assert evaluate(disk + 0.5, disk, metrics={"largest": largest}) == {"largest": 0.5}


@pytest.mark.parametrize("metric", METRICS.values())
def test_every_metric_refuses_what_is_not_finite(metric: object, disk: torch.Tensor) -> None:
    broken = disk.clone()
    broken[3, 4] = math.nan
    with pytest.raises(ValueError, match="The image has values that are not finite"):
        metric(broken, disk)


@pytest.mark.parametrize("metric", [rmse_hu, bias_hu, ABDOMEN_PSNR, ABDOMEN_SSIM])
def test_every_metric_refuses_another_shape(metric: object, disk: torch.Tensor) -> None:
    with pytest.raises(ValueError, match=r"must have one shape, got \(32, 32\) and \(32, 31\)"):
        metric(disk, disk[:, 1:])


def test_masks_that_are_empty_or_of_another_shape_are_refused(disk: torch.Tensor) -> None:
    air = torch.zeros_like(disk)
    with pytest.raises(ValueError, match="mask is empty"):
        rmse_hu(air, air, mask=soft_tissue_mask(air))
    with pytest.raises(ValueError, match="The mask is empty"):
        evaluate(air, air)
    with pytest.raises(ValueError, match="A mask must have the shape"):
        rmse_hu(disk, disk, mask=torch.ones(3, 3, dtype=torch.bool))


def test_a_window_without_width_and_a_tiny_image_are_refused(disk: torch.Tensor) -> None:
    with pytest.raises(ValueError, match="lower to a higher"):
        psnr(disk, disk, window=(40.0, 40.0))
    with pytest.raises(ValueError, match="at least 11 x 11"):
        ABDOMEN_SSIM(disk[:10], disk[:10])
