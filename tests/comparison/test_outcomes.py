from dataclasses import replace
from pathlib import Path

import pytest
import torch
from small_evidence import PLAN, TRUTH, A, SmallPlan, evidence, images

from pnpct.comparison.candidates import Candidate, blurred, filtered
from pnpct.comparison.honesty import Evidence
from pnpct.comparison.outcomes import errors_against_fbp, lesions
from pnpct.comparison.results import Method
from pnpct.evaluation import rmse_hu


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Evidence:
    return evidence(tmp_path_factory.mktemp("outcomes"))


def with_lesion(of: Evidence):
    candidates = filtered("hann"), blurred(6.0)
    made = {each.method.name: each.make(of.sinogram, A) for each in candidates}
    return lesions(of, made, candidates)


def test_fbp_keeps_a_lesion_and_a_strong_blur_does_not(small: Evidence) -> None:
    results, checks = with_lesion(small)
    assert [check.verdict for check in checks] == ["pass", "fail"]
    assert [check.value for check in checks] == [result.recovered for result in results]
    assert {(check.low, check.high) for check in checks} == {(0.8, 1.1)}
    assert checks[0].says.startswith("Of a lesion of 40 mm, −200 HU the image has")


def test_a_lesion_that_the_data_hardly_show_need_not_be_kept(small: Evidence) -> None:
    results, checks = with_lesion(replace(small, plan=replace(PLAN, lesion_hu=-0.5)))
    assert results[1].recovered < 0.8
    assert {check.verdict for check in checks} == {"not judged"}


def test_where_there_is_no_soft_tissue_the_lesion_is_left_out_and_said_to_be(tmp_path: Path) -> None:
    lung = evidence(tmp_path, truth=0.3 * TRUTH)
    results, (check,) = with_lesion(lung)
    assert results == ()
    assert (check.verdict, check.value, check.method) == ("not judged", None, None)
    too_large = replace(lung, truth=TRUTH, plan=replace(PLAN, lesion_diameter=260.0))
    assert with_lesion(too_large)[0] == ()


def test_a_lesion_of_no_contrast_is_no_lesion(small: Evidence) -> None:
    assert with_lesion(replace(small, plan=replace(PLAN, lesion_hu=0.0))) == ((), ())


def test_a_method_must_have_less_error_than_fbp_with_its_best_kernel(small: Evidence) -> None:
    def method(name: str) -> Candidate:
        return Candidate(Method(name, name, "plug-and-play"), lambda sinogram, projector: TRUTH)

    inside = small.body
    kernels = {
        kernel: filtered(kernel).make(small.sinogram, A) for kernel in ("ram-lak", "shepp-logan", "hann", "soft")
    }
    best = min(rmse_hu(image, TRUTH, mask=inside) for image in kernels.values())
    made = {"good": TRUTH + 0.0009 * best, "bad": TRUTH + 0.0011 * best, **images(small)}
    checks = {
        check.method: check
        for check in errors_against_fbp(small, made, [*SmallPlan().candidates()[:2], method("good"), method("bad")])
    }
    assert {name: check.verdict for name, check in checks.items()} == {"good": "pass", "bad": "fail"}
    assert checks["bad"].value == pytest.approx(1.1, rel=1e-3)


def test_without_truth_or_body_there_is_no_error(tmp_path: Path) -> None:
    for truth in (None, torch.zeros(64, 64)):
        of = evidence(tmp_path, truth=truth)
        assert list(errors_against_fbp(of, images(of), of.plan.candidates())) == []
