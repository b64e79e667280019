from dataclasses import replace
from pathlib import Path

import pytest
import torch
from small_evidence import STUDY, TRUTH, A, evidence, fixed, images, methods

from pnpct.comparison import controls
from pnpct.comparison.data_checks import Evidence
from pnpct.comparison.lesion_checks import lesions
from pnpct.comparison.truth_checks import errors_against_fbp
from pnpct.evaluation import rmse_hu


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Evidence:
    return evidence(tmp_path_factory.mktemp("lesions"), methods(blur=6.0))


def with_lesion(of: Evidence):
    return lesions(of, images(of))


def test_fbp_keeps_a_lesion_and_a_strong_blur_does_not(small: Evidence) -> None:
    found, checks = with_lesion(small)
    assert {name: each.lesion.contrast_hu for name, each in found.items()} == {"fbp": -200.0, "blurred-fbp": -200.0}
    assert [check.verdict for check in checks] == ["pass", "fail"]
    assert [check.value for check in checks] == [each.recovered for each in found.values()]
    assert {(check.low, check.high) for check in checks} == {(0.8, 1.1)}
    assert checks[0].says.startswith("Of a lesion of 40 mm, −200 HU the image has")


def test_a_lesion_that_the_data_hardly_show_need_not_be_kept(small: Evidence) -> None:
    found, checks = with_lesion(replace(small, study=replace(STUDY, lesion_hu=-0.5)))
    assert found["blurred-fbp"].recovered < 0.8
    assert {check.verdict for check in checks} == {"not judged"}


def test_where_there_is_no_soft_tissue_the_lesion_is_left_out_and_said_to_be(tmp_path: Path) -> None:
    lung = evidence(tmp_path, truth=0.3 * TRUTH)
    found, (check,) = with_lesion(lung)
    assert found == {}
    assert (check.verdict, check.value, check.method) == ("not judged", None, None)
    too_large = replace(lung, truth=TRUTH, study=replace(STUDY, lesion_diameter=260.0))
    assert with_lesion(too_large)[0] == {}


def test_a_lesion_of_no_contrast_is_no_lesion(small: Evidence) -> None:
    assert with_lesion(replace(small, study=replace(STUDY, lesion_hu=0.0))) == ({}, ())


def test_a_method_must_have_less_error_than_fbp_with_its_best_kernel(small: Evidence) -> None:
    kernels = (controls(kernel).baseline for kernel in ("ram-lak", "shepp-logan", "hann", "soft"))
    best = min(rmse_hu(each.make(small.sinogram, A), TRUTH, mask=small.body) for each in kernels)
    good, bad = (fixed(name, TRUTH + factor * best) for name, factor in (("good", 0.0009), ("bad", 0.0011)))
    of_both = replace(small, methods=methods(good, bad))
    checks = {check.method: check for check in errors_against_fbp(of_both, images(of_both))}
    assert {name: check.verdict for name, check in checks.items()} == {"good": "pass", "bad": "fail"}
    assert checks["bad"].value == pytest.approx(1.1, rel=1e-3)


def test_without_truth_or_body_there_is_no_error(tmp_path: Path) -> None:
    for truth in (None, torch.zeros(64, 64)):
        of = evidence(tmp_path, truth=truth)
        assert list(errors_against_fbp(of, images(of))) == []
