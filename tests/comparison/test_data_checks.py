from dataclasses import replace
from pathlib import Path

import pytest
import torch
from small_evidence import FAKE, STUDY, TRUTH, A, disc, evidence, fixed, images, methods, sinogram, swept

from pnpct.comparison import Check
from pnpct.comparison.data_checks import LARGEST_HELD_OUT_T, Evidence, cross_view, judge, weaker_prior
from pnpct.evaluation import consistency, score_test, split_views
from pnpct.files import read_image

RESIDUAL = ("residual chi-square", "residual correlation along views", "residual correlation along bins")


def by_name(checks: tuple[Check, ...], method: str) -> dict[str, Check]:
    return {check.name: check for check in checks if check.method == method}


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Evidence:
    return evidence(tmp_path_factory.mktemp("checks"), methods(fixed("liar", TRUTH + FAKE)))


@pytest.fixture(scope="module")
def judged(small: Evidence):
    return judge(small, {"fbp": TRUTH, "blurred-fbp": images(small)["blurred-fbp"], "liar": TRUTH + FAKE})


def test_the_truth_is_in_keeping_with_its_data_and_a_blur_is_not(judged) -> None:
    _, checks = judged
    assert [by_name(checks, "fbp")[name].verdict for name in RESIDUAL] == ["pass"] * 3
    assert by_name(checks, "fbp")["residual chi-square"].value == pytest.approx(1.0)
    assert [by_name(checks, "blurred-fbp")[name].verdict for name in RESIDUAL] == ["fail"] * 3


def test_structure_that_is_hidden_behind_fitted_noise_fails_by_its_correlation(small: Evidence) -> None:
    # Noise that was fitted makes room for structure: by its size alone the residual is blameless.
    fitted = small.sinogram.line_integrals - 0.6 * (small.sinogram.line_integrals - A(TRUTH))
    quiet = replace(small.sinogram, line_integrals=fitted)
    hidden = replace(small, sinogram=quiet)
    vars(hidden)["trusted"] = consistency(TRUTH, small.sinogram, A)
    wide = TRUTH + 0.004 * disc(0.0, 0.0, 60.0)
    _, checks = judge(hidden, {"fbp": wide, "liar": TRUTH})
    verdicts = [by_name(checks, "fbp")[name].verdict for name in RESIDUAL]
    assert verdicts == ["pass", "fail", "fail"]
    assert [by_name(checks, "liar")[name].verdict for name in RESIDUAL] == ["pass"] * 3


def test_a_score_fails_beyond_its_limit_and_never_passes(judged) -> None:
    _, checks = judged
    small_score, fake = (by_name(checks, name)["largest score"] for name in ("fbp", "liar"))
    assert abs(small_score.value) < 5 < abs(fake.value)
    assert (small_score.verdict, fake.verdict) == ("not judged", "fail")
    assert "says little" in small_score.says
    assert "says little" not in fake.says


def test_without_a_trusted_image_nothing_is_judged(tmp_path: Path) -> None:
    measured = evidence(tmp_path, methods(fixed("liar", TRUTH + FAKE)), truth=None)
    _, checks = judge(measured, {"blurred-fbp": images(measured)["blurred-fbp"], "liar": TRUTH + FAKE})
    assert len(checks) == 8
    assert {check.verdict for check in (*checks, *cross_view(measured))} == {"not judged"}
    assert all(by_name(checks, "liar")[name].high is None for name in RESIDUAL)


def test_maps_are_nothing_outside_the_body_and_the_verifiable_contrast_is_one(judged, small: Evidence) -> None:
    maps, _ = judged
    assert set(maps) == {"fbp", "blurred-fbp", "liar"}
    assert len({of_image["verifiable_hu"] for of_image in maps.values()}) == 1
    assert len({of_image["t"].sha256 for of_image in maps.values()}) == 3
    for stored in maps["liar"].values():
        values, _ = read_image(small.folder.comparison / stored.file)
        assert bool((values[~small.body] == 0).all())
        assert bool((values[small.body] != 0).all())


def test_a_body_at_the_border_has_no_contrast_where_no_disc_fits(tmp_path: Path) -> None:
    wide = evidence(tmp_path, truth=torch.ones(64, 64))
    assert bool(wide.body.all())
    maps, _ = judge(wide, {"fbp": torch.ones(64, 64)})
    values, _ = read_image(tmp_path / maps["fbp"]["verifiable_hu"].file)
    assert bool(values.isfinite().all())
    assert values[0, 0] == 0 < values[32, 32]


def test_an_empty_image_is_not_judged(tmp_path: Path) -> None:
    empty = evidence(tmp_path, truth=torch.zeros(64, 64))
    maps, (check,) = judge(empty, images(empty))
    assert maps == {}
    assert check.verdict == "not judged"
    assert list(cross_view(empty)) == []
    assert weaker_prior(empty, images(empty)) == ({}, ())


def test_what_a_method_invents_does_not_pass_in_views_that_it_has_not_seen(small: Evidence) -> None:
    of_all = replace(small, methods=methods(fixed("honest", TRUTH + 0.01 * FAKE), fixed("liar", TRUTH + FAKE)))
    _, blurred, honest, liar = cross_view(of_all)
    assert [check.verdict for check in (honest, blurred, liar)] == ["pass", "fail", "fail"]
    assert liar.high == -liar.low == LARGEST_HELD_OUT_T
    assert liar.value < 0
    measured = replace(small, truth=None)
    _, odd = split_views(small.sinogram, A)
    raw = score_test(TRUTH + FAKE, odd.sinogram, odd.projector, diameter=small.disc)
    *_, alone = cross_view(replace(measured, folder=replace(small.folder, place="again")))
    assert alone.value == pytest.approx(raw.strongest_within(measured.body).t)


def test_what_beam_hardening_leaves_even_in_the_truth_is_taken_off(tmp_path: Path) -> None:
    data = sinogram()
    hardened = replace(data, line_integrals=data.line_integrals + A(0.5 * FAKE))
    of = replace(evidence(tmp_path, methods(fixed("liar", TRUTH + FAKE))), sinogram=hardened)
    _, checks = judge(of, {"fbp": TRUTH, "liar": TRUTH + 2 * FAKE})
    assert float(of.score.max()) > 5
    fine, fake = (by_name(checks, name)["largest score"] for name in ("fbp", "liar"))
    assert (fine.value, fine.verdict, fake.verdict) == (0.0, "not judged", "fail")


def test_other_views_are_left_out_with_the_lesion(small: Evidence) -> None:
    assert list(cross_view(replace(small, study=replace(STUDY, lesion_hu=0.0)))) == []


def test_methods_without_a_prior_are_not_swept(small: Evidence) -> None:
    assert weaker_prior(small, images(small)) == ({}, ())


@pytest.mark.parametrize(("beta", "words"), [(1.0, "the scores say"), (0.02, "only the prior vouches")])
def test_what_the_prior_changes_is_shown_and_left_to_readers(tmp_path: Path, beta: float, words: str) -> None:
    small = evidence(tmp_path, swept(beta))
    maps, (check,) = weaker_prior(small, images(small))
    assert check.verdict == "not judged"
    assert (check.value > 1) == (beta == 1.0)
    assert words in check.says
    difference, _ = read_image(tmp_path / maps["prior"]["difference_hu"].file)
    # The prior takes 0.45 of beta of 200 HU away, and a disc of its size has most of that in its middle.
    assert difference.min() == pytest.approx(-90.0 * beta, rel=0.2)
    assert bool((difference[~small.body] == 0).all())
