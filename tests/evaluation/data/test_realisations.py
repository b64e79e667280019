from dataclasses import replace

import pytest
import torch
from low_dose_slice import low_dose_slice

from pnpct.evaluation import consistency, parametric_bootstrap, redraw, score_test, split_views
from pnpct.geometry import FanBeam, ImageGrid, evenly_spaced_views
from pnpct.operators import Projector
from pnpct.physics import BandedWeights, BoneHardening, DiagonalWeights, Sinogram
from pnpct.reconstruction import fbp

SLICE = low_dose_slice()
DATA = SLICE.sinogram()
CLEAN = SLICE.projector(SLICE.truth)


def test_redrawn_noise_has_the_variance_of_the_weights() -> None:
    drawn = redraw(DATA, CLEAN, generator=torch.Generator().manual_seed(2))
    scores = (drawn.line_integrals - CLEAN) * DATA.weights.diagonal.sqrt()
    assert abs(float(scores.mean())) < 4 / scores.numel() ** 0.5
    assert float(scores.square().mean()) == pytest.approx(1.0, abs=4 * (2 / scores.numel()) ** 0.5)
    assert drawn.weights is DATA.weights


def test_rays_that_do_not_count_get_no_noise() -> None:
    weights = DATA.weights.diagonal.clone()
    weights[:, 10] = 0.0
    drawn = redraw(Sinogram(CLEAN, DiagonalWeights(weights)), CLEAN, generator=torch.Generator().manual_seed(2))
    assert torch.equal(drawn.line_integrals[:, 10], CLEAN[:, 10])
    assert not torch.equal(drawn.line_integrals[:, 11], CLEAN[:, 11])


def test_the_bootstrap_draws_around_the_projection_of_the_image() -> None:
    draws = list(
        parametric_bootstrap(
            lambda data: data.line_integrals.mean() * SLICE.truth,
            SLICE.truth,
            DATA,
            SLICE.projector,
            realisations=4,
            generator=torch.Generator().manual_seed(3),
        )
    )
    assert len(draws) == 4
    for draw in draws:
        assert torch.equal(draw.image, draw.sinogram.line_integrals.mean() * SLICE.truth)
        scores = (draw.sinogram.line_integrals - CLEAN) * DATA.weights.diagonal.sqrt()
        assert float(scores.std()) == pytest.approx(1.0, abs=0.03)
    assert not torch.equal(draws[0].sinogram.line_integrals, draws[1].sinogram.line_integrals)


def test_the_bootstrap_of_a_linear_reconstruction_has_the_spread_of_repeated_scans() -> None:
    def smooth(sinogram: Sinogram) -> torch.Tensor:
        return fbp(sinogram.line_integrals, SLICE.projector, kernel="soft")

    generator = torch.Generator().manual_seed(1)
    draws = parametric_bootstrap(smooth, smooth(DATA), DATA, SLICE.projector, realisations=30, generator=generator)
    bootstrapped = torch.stack([draw.image for draw in draws]).var(dim=0)
    scans = torch.stack([smooth(SLICE.sinogram(seed=seed)) for seed in range(30)]).var(dim=0)
    assert float(bootstrapped[SLICE.inside].mean() / scans[SLICE.inside].mean()) == pytest.approx(1.0, abs=0.1)


def test_the_halves_of_a_scan_are_its_even_and_odd_views() -> None:
    geometry = FanBeam(
        evenly_spaced_views(9), 12, 541.0, 949.0, 40.0, focal_spot_shifts=[(0.5 * view, 0.0) for view in range(9)]
    )
    projector = Projector(ImageGrid(16, 16, spacing=16.0), geometry, mu_water=0.03, method="joseph")
    image = torch.rand(16, 16, generator=torch.Generator().manual_seed(1))
    whole = Sinogram(projector(image), DiagonalWeights(1 + torch.arange(108.0).reshape(9, 12)))
    even, odd = split_views(whole, projector)
    for half, views in ((even, slice(0, None, 2)), (odd, slice(1, None, 2))):
        assert torch.equal(half.sinogram.line_integrals, whole.line_integrals[views])
        assert torch.equal(half.sinogram.weights.diagonal, whole.weights.diagonal[views])
        torch.testing.assert_close(half.projector(image), whole.line_integrals[views])


def test_what_cannot_be_redrawn_or_split_is_refused() -> None:
    banded = Sinogram(CLEAN, BandedWeights((1 / DATA.weights.diagonal)[:, None, :]))
    with pytest.raises(ValueError, match="independent noise only"):
        redraw(banded, CLEAN, generator=torch.Generator())
    with pytest.raises(ValueError, match="at least one realisation, got 0"):
        next(
            parametric_bootstrap(
                lambda data: SLICE.truth,
                SLICE.truth,
                DATA,
                SLICE.projector,
                realisations=0,
                generator=torch.Generator(),
            )
        )
    one = replace(SLICE.projector.geometry, view_angles=(0.0,))
    with pytest.raises(ValueError, match="two views or more"):
        split_views(
            Sinogram(CLEAN[:1], DiagonalWeights(DATA.weights.diagonal[:1])), Projector(SLICE.projector.grid, one)
        )


def test_what_would_still_be_corrected_for_bone_is_refused() -> None:
    data = replace(DATA, bone=BoneHardening(torch.zeros(1, 6), compact=2.5))
    generator = torch.Generator().manual_seed(2)
    for test in (
        lambda: redraw(data, CLEAN, generator=generator),
        lambda: split_views(data, SLICE.projector),
        lambda: consistency(SLICE.truth, data, SLICE.projector),
        lambda: score_test(SLICE.truth, data, SLICE.projector, diameter=20.0),
    ):
        with pytest.raises(ValueError, match="corrected_for_bone"):
            test()
