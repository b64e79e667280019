import math

import numpy as np
import pytest
import torch
from scipy.ndimage import uniform_filter
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

from pnpct.evaluation import (
    psnr_ldctbench,
    psnr_lodopab,
    psnr_lodopab_fr,
    ssim_ldctbench,
    ssim_lodopab,
    ssim_lodopab_fr,
)

LODOPAB = (psnr_lodopab, psnr_lodopab_fr, ssim_lodopab, ssim_lodopab_fr)


@pytest.fixture
def pair(disk: torch.Tensor, generator: torch.Generator) -> tuple[torch.Tensor, torch.Tensor]:
    """Two slices with values beyond every window, and what they should be."""
    truth = torch.stack([disk, 0.5 + disk.flip(0)]).double()
    truth[:, 15, 15] = 9.0
    return truth + 0.2 * torch.randn(truth.shape, generator=generator, dtype=torch.float64), truth


def windowed(image: torch.Tensor, level: float, width: float) -> np.ndarray:
    """As a DICOM viewer does (PS3.3 C.11.2.1.2), on stored values with an offset of 1024."""
    stored, center = 1000 * (image.numpy() - 1) + 1024, level + 1024
    inside = ((stored - (center - 0.5)) / (width - 1) + 0.5).clip(0, 1)
    return np.where(stored <= center - 0.5 - (width - 1) / 2, 0, inside)


@pytest.mark.parametrize(("exam", "level", "width"), [("chest", -600, 1500), ("abdomen", 50, 400), ("head", 40, 80)])
def test_scikit_image_agrees_with_the_scores_of_ldct_benchmark(
    pair: tuple[torch.Tensor, torch.Tensor], exam: str, level: float, width: float
) -> None:
    a, b = (windowed(one, level, width) for one in pair)
    psnr = [peak_signal_noise_ratio(y, x, data_range=1) for x, y in zip(a, b, strict=True)]
    ssim = [structural_similarity(y, x, data_range=1) for x, y in zip(a, b, strict=True)]
    assert psnr_ldctbench(*pair, exam=exam) == pytest.approx(np.mean(psnr), abs=1e-6)
    assert ssim_ldctbench(*pair, exam=exam) == pytest.approx(np.mean(ssim), abs=1e-6)


def test_scikit_image_agrees_with_the_scores_of_lodopab(pair: tuple[torch.Tensor, torch.Tensor]) -> None:
    a, b = (((one.numpy() - 1) * (20 - 0.02) + 20) / 81.35858 for one in pair)
    b = b.clip(0, 1)
    assert b.max() == 1.0
    for fixed, (psnr, ssim) in ((False, LODOPAB[::2]), (True, LODOPAB[1::2])):
        ranges = [1.0 if fixed else np.ptp(y) for y in b]
        expected = [peak_signal_noise_ratio(y, x, data_range=r) for x, y, r in zip(a, b, ranges, strict=True)]
        assert psnr(*pair) == pytest.approx(np.mean(expected), abs=1e-6)
        expected = [structural_similarity(y, x, data_range=r) for x, y, r in zip(a, b, ranges, strict=True)]
        assert ssim(*pair) == pytest.approx(np.mean(expected), abs=1e-6)


def test_the_similarity_is_that_of_the_formula(pair: tuple[torch.Tensor, torch.Tensor]) -> None:
    a, b = (windowed(one, 50, 400)[0] for one in pair)

    def local(values: np.ndarray) -> np.ndarray:
        return uniform_filter(values, 7)[3:-3, 3:-3]

    mean_a, mean_b, sample = local(a), local(b), 49 / 48
    covariance = sample * (local(a * b) - mean_a * mean_b)
    variances = sample * (local(a * a) - mean_a**2 + local(b * b) - mean_b**2)
    similarity = (2 * mean_a * mean_b + 1e-4) * (2 * covariance + 9e-4)
    similarity /= (mean_a**2 + mean_b**2 + 1e-4) * (variances + 9e-4)
    assert ssim_ldctbench(pair[0][0], pair[1][0], exam="abdomen") == pytest.approx(similarity.mean(), abs=1e-6)


def test_the_range_of_each_slice_is_its_own(pair: tuple[torch.Tensor, torch.Tensor]) -> None:
    alone = [psnr_lodopab(image, truth) for image, truth in zip(*pair, strict=True)]
    assert psnr_lodopab(*pair) == pytest.approx(np.mean(alone), rel=1e-12)
    assert psnr_lodopab_fr(*pair) > psnr_lodopab(*pair)


def test_equal_images_have_no_error(pair: tuple[torch.Tensor, torch.Tensor]) -> None:
    _, truth = pair
    assert psnr_ldctbench(truth, truth, exam="head") == math.inf
    assert ssim_ldctbench(truth, truth, exam="chest") == pytest.approx(1.0)
    inside = truth.clamp(0, 4)
    assert [score(inside, inside) for score in LODOPAB] == pytest.approx([math.inf, math.inf, 1.0, 1.0])


def test_what_cannot_be_scored_is_refused(disk: torch.Tensor) -> None:
    with pytest.raises(TypeError, match="exam"):  # no range, no score
        psnr_ldctbench(disk, disk)
    with pytest.raises(ValueError, match="constant has no range"):
        psnr_lodopab(disk, torch.ones_like(disk))
    with pytest.raises(ValueError, match="at least 7 x 7"):
        ssim_lodopab_fr(disk[:6], disk[:6])
    for score in LODOPAB:
        with pytest.raises(ValueError, match="one shape"):
            score(disk, disk[:, 1:])
        with pytest.raises(ValueError, match="not finite"):
            score(disk * math.nan, disk)
