"""The small table: what stands in its cells, which mark it has, and in which order methods come."""

import re
from dataclasses import replace

import pytest
from small_comparison import make_comparison

from pnpct.comparison import Check, Comparison
from pnpct.report.results import Results
from pnpct.report.summary import Mark, summary


@pytest.fixture(scope="module")
def comparison(tmp_path_factory) -> Comparison:
    return make_comparison(tmp_path_factory.mktemp("summary"))


def measures(comparison):
    return {measure.title: measure for measure in summary(Results(comparison)).measures}


def numbers(measure):
    return [re.sub("<[^>]*>", "", cell.number) for cell in measure.cells]


def test_the_best_method_comes_first_and_controls_last(comparison):
    found = summary(Results(comparison))
    assert [label for _, label, _ in found.methods] == ["PnP-ADMM", "FBP", "Blurred FBP (control)"]
    methods = tuple(replace(m, role="compared") if m.name == "fbp-blurred" else m for m in comparison.methods)
    worse = {case: {**of, "pnp": {"soft_tissue_rmse_hu": 99.0}} for case, of in comparison.fidelity.items()}
    assert Results(replace(comparison, methods=methods, fidelity=worse)).methods == ("fbp-blurred", "fbp", "pnp")


def test_without_a_truth_the_method_that_was_named_last_comes_first(comparison):
    results = Results(replace(comparison, fidelity={}))
    assert (results.error, results.best) == (None, "pnp")
    assert "error" not in measures(results.comparison)


def test_a_cell_goes_from_the_least_to_the_largest_over_the_cases(comparison):
    error = measures(comparison)["error"]
    assert error.unit == "HU"
    assert numbers(error) == ["13.7 to 14.7", "41.2 to 42.2", "20.6 to 21.6"]
    assert numbers(measures(comparison)["lesion contrast"]) == ["58.0", "100", "79.0"]  # of one case
    assert "noise" not in measures(comparison)  # no curve has it


def test_sharpness_is_marked_against_the_baseline(comparison):
    marks = [cell.mark for cell in measures(comparison)["sharpness"].cells]
    assert marks == [Mark("fail", 1, 1), None, Mark("fail", 1, 1)]
    curves = tuple(
        replace(curve, summary={"f50_per_mm": 0.46 if curve.method == "pnp" else 0.5}) for curve in comparison.curves
    )
    assert measures(replace(comparison, curves=curves))["sharpness"].cells[0].mark == Mark("pass", 0, 1)


def test_noise_is_marked_against_the_baseline(comparison):
    noises = {"fbp": 30.0, "fbp-blurred": 10.0, "pnp": 31.0}
    curves = tuple(replace(curve, summary={"noise_hu": noises[curve.method]}) for curve in comparison.curves[:3])
    cells = measures(replace(comparison, curves=curves))["noise"].cells
    assert [cell.mark for cell in cells] == [Mark("fail", 1, 1), None, Mark("pass", 0, 1)]


def test_agreement_with_the_data_has_the_worst_verdict_of_all_checks_against_them(comparison):
    misfit = measures(comparison)["misfit to the data"]
    assert numbers(misfit) == ["1.01 to 1.31", "", ""]
    assert [cell.mark for cell in misfit.cells] == [Mark("fail", 1, 3), None, None]
    unjudged = Check("largest score", "head", "fbp", 3.0, -5.0, 5.0, "not judged", "It says little.")
    changed = replace(comparison, checks=(*comparison.checks, unjudged))
    assert measures(changed)["misfit to the data"].cells[1].mark == Mark("not judged", 0, 1)


def test_a_comparison_of_nothing_has_an_empty_table(comparison):
    bare = Comparison(comparison.provenance, {}, comparison.methods, ())
    assert summary(Results(bare)).measures == ()
