import math

import numpy as np
import pytest
import torch
from low_dose_slice import disc as disc_at
from low_dose_slice import low_dose_slice, pixel_at

from pnpct.denoisers import TotalVariation
from pnpct.evaluation import score_test, score_threshold, split_views
from pnpct.evaluation.data.disc_information import disc_information
from pnpct.physics import DiagonalWeights, Sinogram
from pnpct.reconstruction import reconstruct

SLICE = low_dose_slice()
GRID, PROJECTOR = SLICE.grid, SLICE.projector
PLACE = (32.5, -22.5)
AT = pixel_at(GRID, PLACE)


def disc(diameter: float, position: tuple[float, float] = PLACE) -> torch.Tensor:
    return disc_at(position, diameter / 2, GRID)


@pytest.mark.parametrize("diameter", [12.0, 20.0])
def test_the_information_of_a_disc_is_that_of_its_projection(diameter: float) -> None:
    weights = SLICE.sinogram().weights
    information = disc_information(weights, PROJECTOR, diameter)
    ratios = []
    for row, col in np.random.default_rng(1).integers(5, 59, (40, 2)):
        q = PROJECTOR(disc(diameter, (float(GRID.x[col]), float(GRID.y[row])))) / 1000
        ratios.append(float(information[row, col] / (weights.diagonal * q * q).sum()))
    assert ratios == pytest.approx(np.ones(40), abs=0.08)
    assert np.std(ratios) < 0.03


def test_a_fake_disc_is_found_at_its_place_with_its_size() -> None:
    """A disc that is worth six standard deviations gives T = −6 there, plus the noise of the data."""
    clean = SLICE.sinogram(seed=None)
    worth_6 = 6 * float(score_test(SLICE.truth, clean, PROJECTOR, diameter=12.0).verifiable_hu[AT]) / 4
    faked = SLICE.truth + worth_6 / 1000 * disc(12.0)
    without_noise = score_test(faked, clean, PROJECTOR, diameter=12.0)
    assert without_noise.strongest.t == pytest.approx(-6.0, abs=0.2)
    assert without_noise.strongest.missing_hu == pytest.approx(-worth_6, rel=0.05)
    assert without_noise.strongest.position == pytest.approx(PLACE)
    for seed in range(3):
        found = score_test(faked, SLICE.sinogram(seed=seed), PROJECTOR, diameter=12.0)
        assert math.dist(found.strongest.position, PLACE) <= 6.0
        assert float(found.t[AT]) == pytest.approx(-6.0, abs=2.5)


def test_an_erased_lesion_is_missing_and_an_invented_one_is_too_much() -> None:
    clean = SLICE.sinogram(SLICE.truth + 0.08 * disc(20.0), seed=None)
    erased = score_test(SLICE.truth, clean, PROJECTOR, diameter=20.0)
    assert erased.strongest.missing_hu == pytest.approx(80.0, rel=0.05)
    assert erased.strongest.t > 0
    honest = score_test(SLICE.truth + 0.08 * disc(20.0), clean, PROJECTOR, diameter=20.0)
    assert abs(honest.strongest.t) < 1e-2


def test_t_of_the_truth_is_standard_normal() -> None:
    maps = torch.stack([score_test(SLICE.truth, SLICE.sinogram(seed=seed), PROJECTOR).t for seed in range(30)])
    at_places = maps[:, 5:-5:7, 5:-5:7]
    assert abs(float(at_places.mean())) < 0.15
    assert float(at_places.std()) == pytest.approx(1.0, abs=0.06)
    assert 3.0 < float(maps.abs().amax(dim=(-2, -1)).mean()) < 4.5


def test_the_verifiable_contrast_falls_with_the_root_of_the_dose() -> None:
    once, twice = (
        score_test(SLICE.truth, SLICE.sinogram(quanta=quanta), PROJECTOR).verifiable_hu for quanta in (1e4, 2e4)
    )
    seen = once.isfinite()
    assert seen.float().mean() > 0.8
    torch.testing.assert_close(once[seen], twice[seen] * 2**0.5, rtol=0.02, atol=0)


def test_the_middle_of_the_body_hides_more_than_its_edge() -> None:
    verifiable = score_test(SLICE.truth, SLICE.sinogram(), PROJECTOR, diameter=12.0).verifiable_hu
    assert float(verifiable[32, 32]) > 1.3 * float(verifiable[32, 56])


def test_factors_of_the_weights_drop_out_by_the_floor() -> None:
    data = SLICE.sinogram()
    plain = score_test(SLICE.truth, data, PROJECTOR)
    scaled = Sinogram(data.line_integrals, DiagonalWeights(5 * data.weights.diagonal))
    divided = score_test(SLICE.truth, scaled, PROJECTOR, floor=5.0)
    for name in ("t", "missing_hu", "verifiable_hu"):
        torch.testing.assert_close(getattr(divided, name), getattr(plain, name), rtol=1e-4, atol=1e-4)


def test_images_of_one_scan_can_share_what_their_discs_are_worth() -> None:
    data = SLICE.sinogram()
    information = disc_information(data.weights, PROJECTOR, 12.0)
    own = score_test(SLICE.truth, data, PROJECTOR, diameter=12.0, floor=1.3)
    shared = score_test(SLICE.truth, data, PROJECTOR, diameter=12.0, floor=1.3, information=information)
    for name in ("t", "missing_hu", "verifiable_hu"):
        assert torch.equal(getattr(shared, name), getattr(own, name))


def test_nothing_is_said_where_no_disc_fits_or_no_ray_goes() -> None:
    data = SLICE.sinogram()
    weights = data.weights.diagonal.clone()
    weights[1:] = weights[:, :50] = weights[:, 70:] = 0.0  # the middle of one view alone, from above
    found = score_test(SLICE.truth, Sinogram(data.line_integrals, DiagonalWeights(weights)), PROJECTOR)
    dark = ~found.verifiable_hu.isfinite()
    assert bool(dark[0].all())
    assert bool(dark[:, :16].all())
    assert not bool(dark[2:-2, 30:34].any())
    assert bool((found.t[dark] == 0).all())
    assert bool((found.missing_hu[dark] == 0).all())


def test_a_mask_says_where_to_look() -> None:
    found = score_test(SLICE.truth + 0.3 * disc(12.0), SLICE.sinogram(), PROJECTOR, diameter=12.0)
    away = disc(60.0) == 0
    elsewhere = found.strongest_within(away)
    assert math.dist(elsewhere.position, PLACE) > 30.0
    assert abs(elsewhere.t) < abs(found.strongest.t) / 2
    with pytest.raises(ValueError, match="at least one that counts"):
        found.strongest_within(torch.zeros(GRID.shape, dtype=torch.bool))


def test_the_threshold_is_a_quantile_of_what_honest_images_have() -> None:
    def known(_: Sinogram) -> torch.Tensor:
        return SLICE.truth

    low, high = (
        score_threshold(
            known,
            SLICE.truth,
            SLICE.sinogram(),
            PROJECTOR,
            generator=torch.Generator().manual_seed(1),
            diameter=12.0,
            realisations=12,
            level=level,
        )
        for level in (0.05, 0.95)
    )
    assert 2.5 < low < 3.5 < high < 5.0


def test_a_fit_of_the_noise_makes_t_small_and_its_threshold_with_it() -> None:
    data = SLICE.sinogram()

    def fit(sinogram: Sinogram) -> torch.Tensor:
        return reconstruct(sinogram, PROJECTOR, TotalVariation(strength=0.02), iterations=6)

    image = fit(data)
    threshold = score_threshold(
        fit,
        image,
        data,
        PROJECTOR,
        generator=torch.Generator().manual_seed(1),
        diameter=12.0,
        mask=SLICE.inside,
        realisations=6,
    )
    assert threshold < 2.5
    found = score_test(image + 0.12 * disc(12.0), data, PROJECTOR, diameter=12.0).strongest_within(SLICE.inside)
    assert threshold < abs(found.t) < 4.5
    assert math.dist(found.position, PLACE) <= 6.0


def test_views_that_were_not_used_judge_without_favour() -> None:
    data = SLICE.sinogram()
    _, odd = split_views(data, PROJECTOR)
    held_out = score_test(SLICE.truth + 0.25 * disc(12.0), odd.sinogram, odd.projector, diameter=12.0)
    assert math.dist(held_out.strongest.position, PLACE) <= 6.0
    assert held_out.strongest.missing_hu == pytest.approx(-250.0, abs=3 * float(held_out.verifiable_hu[AT]) / 4)
    whole = score_test(SLICE.truth, data, PROJECTOR, diameter=12.0)
    ratio = held_out.verifiable_hu[AT] / whole.verifiable_hu[AT]
    assert float(ratio) == pytest.approx(2**0.5, rel=0.02)


def test_what_cannot_be_tested_is_refused() -> None:
    data = SLICE.sinogram()
    with pytest.raises(ValueError, match="One slice of"):
        score_test(SLICE.truth[1:], data, PROJECTOR)
    with pytest.raises(ValueError, match="at least one pixel"):
        score_test(SLICE.truth, data, PROJECTOR, diameter=1.0)
    with pytest.raises(ValueError, match="at least twice as wide"):
        score_test(SLICE.truth, data, PROJECTOR, diameter=200.0)
    with pytest.raises(ValueError, match="floor"):
        score_test(SLICE.truth, data, PROJECTOR, floor=-1.0)
    with pytest.raises(ValueError, match="a number for each"):
        score_test(SLICE.truth, data, PROJECTOR, information=torch.ones(2, 2))
    with pytest.raises(ValueError, match="two realisations"):
        score_threshold(
            lambda _: SLICE.truth, SLICE.truth, data, PROJECTOR, generator=torch.Generator(), realisations=1
        )
    edge = torch.zeros(PROJECTOR.geometry.shape)
    edge[0, 0] = 1.0
    with pytest.raises(ValueError, match="hardly any has a weight"):
        score_test(SLICE.truth, Sinogram(data.line_integrals, DiagonalWeights(edge)), PROJECTOR)
