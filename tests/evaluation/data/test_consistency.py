import math
from dataclasses import replace

import pytest
import torch
from low_dose_slice import low_dose_slice

from pnpct.denoisers import Gaussian
from pnpct.evaluation import Consistency, consistency
from pnpct.physics import BandedWeights, DiagonalWeights, Sinogram

SLICE = low_dose_slice()


def test_the_truth_has_a_chi2_of_one() -> None:
    """Within three standard errors of 1, with the true variances."""
    for seed in range(5):
        found = consistency(SLICE.truth, SLICE.sinogram(seed=seed), SLICE.projector)
        assert abs(found.chi2 - 1) < 3 * math.sqrt(2 / found.rays)
        assert found.verdict == "consistent"
        assert max(abs(found.along_views), abs(found.along_bins)) < 4 / math.sqrt(found.rays)


def test_only_rays_through_the_object_that_have_a_weight_count() -> None:
    data = SLICE.sinogram()
    weights = data.weights.diagonal.clone()
    weights[:7] = 0.0
    through = (data.line_integrals > 0.2)[7:]
    found = consistency(SLICE.truth, Sinogram(data.line_integrals, DiagonalWeights(weights)), SLICE.projector)
    assert found.rays == int(through.sum())
    scores = (data.line_integrals - SLICE.projector(SLICE.truth)) * weights.sqrt()
    assert found.chi2 == pytest.approx(float(scores[7:][through].square().mean()), rel=1e-5)


def test_an_image_that_leaves_the_data_is_noticed() -> None:
    found = consistency(Gaussian(strength=1.0)(SLICE.truth), SLICE.sinogram(), SLICE.projector)
    assert found.verdict == "data overridden"
    assert found.along_views > 0.1


def test_an_invented_lesion_hardly_changes_chi2() -> None:
    fake = SLICE.truth.clone()
    fake[30:33, 20:23] -= 0.04
    data = SLICE.sinogram()
    honest, faked = (consistency(image, data, SLICE.projector).chi2 for image in (SLICE.truth, fake))
    assert abs(faked - honest) < 3 * math.sqrt(2 / 8000)


def test_unknown_factors_of_the_weights_drop_out_by_a_trusted_image() -> None:
    data = SLICE.sinogram()
    scaled = Sinogram(data.line_integrals, DiagonalWeights(7 * data.weights.diagonal))
    floor = consistency(SLICE.truth, scaled, SLICE.projector).chi2
    for image in (SLICE.truth, Gaussian(strength=1.0)(SLICE.truth)):
        plain, divided = (
            consistency(image, data, SLICE.projector),
            consistency(image, scaled, SLICE.projector, floor=floor),
        )
        assert divided.chi2 == pytest.approx(7 * plain.chi2)
        assert divided.verdict == plain.verdict


def test_correlated_noise_is_whitened() -> None:
    views, bins = SLICE.projector.geometry.shape
    drawn = 0.01 * torch.randn(views, bins + 1, generator=torch.Generator().manual_seed(4))
    noise = 0.8 * drawn[:, 1:] + 0.6 * drawn[:, :-1]
    bands = 1e-4 * torch.tensor([1.0, 0.48])[None, :, None].repeat(views, 1, bins)
    y = SLICE.projector(SLICE.truth) + noise
    whitened = consistency(SLICE.truth, Sinogram(y, BandedWeights(bands)), SLICE.projector)
    assert whitened.verdict == "consistent"
    alone = Sinogram(y, DiagonalWeights(torch.full((views, bins), 1e4)))
    ignored = consistency(SLICE.truth, alone, SLICE.projector)
    assert ignored.verdict == "residual correlated"
    assert ignored.along_bins == pytest.approx(0.48, abs=0.03)


def test_correlations_are_those_of_neighbours() -> None:
    projector = SLICE.projector
    clean, ones = projector(torch.ones(SLICE.grid.shape)), torch.ones(projector.geometry.shape)
    signs = 1 - 2 * (torch.arange(projector.geometry.views) % 2.0)[:, None]
    alternating = Sinogram(clean + 0.1 * signs, DiagonalWeights(ones))
    found = consistency(torch.ones(SLICE.grid.shape), alternating, projector)
    assert found.along_views == pytest.approx(-1.0, abs=1e-4)
    assert found.along_bins == pytest.approx(1.0, abs=1e-4)


def test_verdicts_follow_their_limits() -> None:
    fine = Consistency(chi2=1.03, rays=20000, along_views=0.0, along_bins=-0.15)
    assert fine.largest_ratio == pytest.approx(1 + 3 * 0.01 + 0.01)
    assert fine.verdict == "consistent"
    assert replace(fine, chi2=1.05).verdict == "data overridden"
    assert replace(fine, chi2=1.05, floor=1.1).verdict == "consistent"
    assert replace(fine, along_views=0.11).verdict == "residual correlated"
    assert replace(fine, chi2=0.1, along_views=-0.9).verdict == "consistent"


def test_what_cannot_be_compared_is_refused() -> None:
    data = SLICE.sinogram()
    with pytest.raises(ValueError, match="positive number, got 0"):
        consistency(SLICE.truth, data, SLICE.projector, floor=0.0)
    air = Sinogram(torch.zeros(SLICE.projector.geometry.shape), data.weights)
    with pytest.raises(ValueError, match="neighbouring rays that see the object"):
        consistency(SLICE.truth, air, SLICE.projector)
