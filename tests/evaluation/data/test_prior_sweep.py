import pytest
import torch
from low_dose_slice import disc, low_dose_slice

from pnpct.evaluation import prior_sweep, score_test

SLICE = low_dose_slice()
TEST = score_test(SLICE.truth, SLICE.sinogram(), SLICE.projector, diameter=15.0)
PLACE = (32.5, -22.5)


def invented(contrast_hu: float, radius: float = 30.0) -> torch.Tensor:
    return SLICE.truth + contrast_hu / 1000 * disc(PLACE, radius, SLICE.grid)


def test_what_only_a_strong_prior_shows_is_found_in_units_of_what_can_be_verified() -> None:
    sweep = prior_sweep({0.3: invented(-30.0), 0.0: SLICE.truth, 1.0: invented(-90.0)}, TEST)
    assert [change.strength for change in sweep] == [0.3, 1.0]
    weak, strong = sweep
    assert weak.change_hu == pytest.approx(-30.0, rel=1e-3)
    assert strong.change_hu == pytest.approx(-90.0, rel=1e-3)
    assert strong.largest == pytest.approx(3 * weak.largest, rel=1e-3)
    row = int(abs(SLICE.grid.y - strong.position[1]).argmin())
    col = int(abs(SLICE.grid.x - strong.position[0]).argmin())
    assert strong.largest == pytest.approx(90.0 / float(TEST.verifiable_hu[row, col]), rel=1e-3)
    assert ((strong.position[0] - PLACE[0]) ** 2 + (strong.position[1] - PLACE[1]) ** 2) ** 0.5 < 30.0
    assert float(strong.difference_hu[row, col]) == pytest.approx(-90.0, rel=1e-3)


def test_noise_of_pixels_that_a_prior_takes_away_counts_for_less_than_a_blob_of_its_size() -> None:
    noise = 0.09 * torch.randn(SLICE.grid.shape, generator=torch.Generator().manual_seed(1))
    (change,) = prior_sweep({0.0: SLICE.truth + noise, 1.0: SLICE.truth}, TEST, mask=SLICE.inside)
    (blob,) = prior_sweep({0.0: SLICE.truth, 1.0: invented(4 * 90.0)}, TEST, mask=SLICE.inside)
    assert 1000 * float(noise[SLICE.inside].abs().max()) > 3 * 90
    assert change.largest < blob.largest / 2


def test_a_mask_says_where_to_look() -> None:
    elsewhere = SLICE.inside & (invented(1000.0) == SLICE.truth)
    (change,) = prior_sweep({0.0: SLICE.truth, 1.0: invented(90.0)}, TEST, mask=elsewhere)
    assert 0 < abs(change.change_hu) < 80.0  # the rim, where discs reach over the outline


def test_a_sweep_needs_two_strengths_on_the_grid_of_the_test() -> None:
    with pytest.raises(ValueError, match="two strengths"):
        prior_sweep({1.0: SLICE.truth}, TEST)
    with pytest.raises(ValueError, match="pixels of the test"):
        prior_sweep({0.0: SLICE.truth, 1.0: SLICE.truth[1:]}, TEST)
    with pytest.raises(ValueError, match="mask must have"):
        prior_sweep({0.0: SLICE.truth, 1.0: SLICE.truth}, TEST, mask=SLICE.inside[1:])
