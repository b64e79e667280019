import math
from dataclasses import replace

import pytest
import torch
from low_dose_slice import low_dose_slice

from pnpct.denoisers import Gaussian
from pnpct.evaluation import Consistency, consistency, fitted_degrees
from pnpct.geometry import FanBeam, ImageGrid, evenly_spaced_views
from pnpct.operators import Projector
from pnpct.physics import BandedWeights, DiagonalWeights, Sinogram

SLICE = low_dose_slice()


def test_the_truth_has_a_chi2_of_one() -> None:
    """E12: within three standard errors of 1, with the true variances."""
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


@pytest.mark.parametrize("ridge", [0.0, 1000.0])
def test_fitted_degrees_are_those_of_linear_algebra(ridge: float) -> None:
    grid = ImageGrid(12, 12, spacing=20.0)
    projector = Projector(grid, FanBeam(evenly_spaced_views(60), 48, 541.0, 949.0, 12.0))
    pixels = torch.eye(144).reshape(144, 12, 12)
    matrix = projector(pixels).reshape(144, -1).T.double()
    image = torch.ones(12, 12)
    line_integrals = projector(image)
    weights = 1e3 * torch.exp(-line_integrals) * (line_integrals > 0.3)  # those that are counted are those that count
    root = weights.sqrt().flatten().double()
    scaled = root[:, None] * matrix
    inverse = torch.linalg.solve(scaled.T @ scaled + ridge * torch.eye(144), scaled.T)

    def fit(data: Sinogram) -> torch.Tensor:
        return (inverse @ (root * data.line_integrals.flatten())).reshape(12, 12).float()

    hat = scaled @ inverse
    expected = float(2 * hat.trace() - (hat * hat).sum())
    generator = torch.Generator().manual_seed(1)
    noise = torch.where(root > 0, torch.randn(root.shape, generator=generator) / root.clamp_min(1e-9), 0.0)
    data = Sinogram(line_integrals + 0.3 * noise.reshape(60, 48).float(), DiagonalWeights(weights))
    found = fitted_degrees(fit, data, projector, generator=generator, probes=100)
    assert found == pytest.approx(expected, abs=3 * math.sqrt(2 * 144 / 100))
    if ridge:
        assert expected > float(hat.trace()) + 10
    else:
        assert expected == pytest.approx(144, rel=1e-3)
        noisy = Sinogram(line_integrals + noise.reshape(60, 48).float(), DiagonalWeights(weights))
        left = consistency(fit(noisy), noisy, projector, fitted=found)
        assert left.chi2 == pytest.approx(1 - 144 / left.rays, abs=3 * left.standard_error)
        assert left.verdict == "consistent"


def test_verdicts_follow_their_bands() -> None:
    fine = Consistency(chi2=0.9, rays=20000, along_views=0.0, along_bins=-0.15, fitted=2000.0)
    assert fine.standard_error == pytest.approx(0.01)
    assert fine.band == pytest.approx((0.86, 1.04))
    assert fine.correlation_band == pytest.approx((-0.1 - 1 / 9, 0.1))
    assert fine.verdict == "consistent"
    assert replace(fine, chi2=0.85).verdict == "noise fitted"
    assert replace(fine, chi2=1.05).verdict == "data overridden"
    assert replace(fine, chi2=1.05, floor=1.1).verdict == "consistent"
    assert replace(fine, along_views=0.11).verdict == "residual correlated"
    assert replace(fine, along_views=-0.3).verdict == "residual correlated"
    unknown = replace(fine, chi2=0.1, fitted=None, along_views=-0.9)
    assert unknown.band[0] == 0.0
    assert unknown.verdict == "consistent"


def test_what_cannot_be_compared_is_refused() -> None:
    data = SLICE.sinogram()
    with pytest.raises(ValueError, match="positive number, got 0"):
        consistency(SLICE.truth, data, SLICE.projector, floor=0.0)
    with pytest.raises(ValueError, match="fewer degrees of freedom"):
        consistency(SLICE.truth, data, SLICE.projector, fitted=1e9)
    air = Sinogram(torch.zeros(SLICE.projector.geometry.shape), data.weights)
    with pytest.raises(ValueError, match="neighbouring rays that see the object"):
        consistency(SLICE.truth, air, SLICE.projector)
    with pytest.raises(ValueError, match="one probe and a positive step"):
        fitted_degrees(lambda _: SLICE.truth, data, SLICE.projector, generator=torch.Generator(), step=0.0)
