"""A saving of dose is spoken of only with tasks, observer, reference kernel, interval and control."""

from dataclasses import replace
from xml.etree import ElementTree

import pytest
from small_comparison import make_comparison

from pnpct.comparison import Comparison, DoseShare, write_comparison
from pnpct.evaluation import Interval
from pnpct.report import write_report
from pnpct.report.dose_words import dose_statements
from pnpct.report.results import Results
from pnpct.report.tasks import equal_dose_table, groups, left_out, task_charts

SVG = "{http://www.w3.org/2000/svg}"
REFERENCE = "FBP hann at 320 mA"


def share(estimate: float, low: float, high: float, outside=None) -> DoseShare:
    return DoseShare(REFERENCE, Interval(estimate, low, high, 0.05, 0.95), outside)


@pytest.fixture(scope="module")
def comparison(tmp_path_factory) -> Comparison:
    return make_comparison(tmp_path_factory.mktemp("dose"))


def said(comparison: Comparison) -> str:
    return " ".join(dose_statements(Results(comparison)))


def with_tasks(comparison: Comparison, change) -> Comparison:
    return replace(comparison, tasks=tuple(task for old in comparison.tasks if (task := change(old)) is not None))


def with_dose(comparison: Comparison, method: str, dose, *, lesion: str = "", least=None) -> Comparison:
    """Change what a method needs for lesions whose words begin so, and for all of them together."""
    changed = with_tasks(
        comparison,
        lambda task: (
            replace(task, equal_dose=dose)
            if task.method == method and task.equal_dose and task.lesion.startswith(lesion)
            else task
        ),
    )
    found = (
        replace(each, equal_dose=least or dose) if each.method == method else each
        for each in comparison.least_reductions
    )
    return replace(changed, least_reductions=tuple(found) if least or dose else comparison.least_reductions)


def test_the_whole_claim_has_tasks_observer_reference_interval_and_control(comparison):
    words = said(comparison)
    for part in ("10 mm, −15 HU", "channelised Hotelling", REFERENCE, "95 % interval", "Blurred FBP"):
        assert part in words
    for number in (">64.0<", ">55.0<", ">73.0<", ">97.0<", ">86.0<", ">109<"):
        assert number in words
    assert "dose reduction" in words


def test_a_claim_that_another_lesion_refutes_is_not_made(comparison):
    one = share(0.80, 0.75, 0.85)
    other = share(0.78, 0.40, 1.15)
    changed = with_dose(comparison, "pnp", one, lesion="5 mm", least=share(0.80, 0.76, 1.15))
    changed = with_dose(changed, "pnp", other, lesion="10 mm", least=share(0.80, 0.76, 1.15))
    assert "dose reduction" not in said(changed)
    assert "No saving is shown: the interval reaches" in said(changed)


def test_a_lesion_for_which_a_blur_does_as_well_refutes_the_claim(comparison):
    fooled = share(0.7, 0.6, 0.8)
    of_all = next(each for each in comparison.least_reductions if each.method == "fbp-blurred").equal_dose
    changed = with_dose(comparison, "fbp-blurred", fooled, lesion="5 mm", least=of_all)
    assert "dose reduction" not in said(changed)


@pytest.mark.parametrize("high", [1.0, 1.2, 0.98, 0.9])
def test_no_saving_is_claimed_where_the_interval_reaches_all_or_that_of_the_control(comparison, high):
    words = said(with_dose(comparison, "pnp", share(0.7, 0.6, high)))
    assert "dose reduction" not in words
    assert "No saving is shown: the interval reaches" in words


@pytest.mark.parametrize(
    ("dose", "words"),
    [
        (share(2.0, 1.6, 2.0, "above"), "more than <data"),
        (share(0.1, 0.1, 0.12, "below"), "less than <data"),
    ],
    ids=["above", "below"],
)
def test_worse_than_at_the_highest_dose_and_better_than_at_the_lowest_are_told_apart(comparison, dose, words):
    changed = with_dose(comparison, "pnp", dose)
    assert words in said(changed)
    assert ("takes more dose than with the reference" in said(changed)) == (dose.outside == "above")
    assert ("dose reduction" in said(changed)) == (dose.outside == "below")
    cells = [row.cells[3] for row in equal_dose_table(Results(changed)).rows if row.label == "PnP-ADMM"]
    assert len(cells) == 3
    assert all(words in cell for cell in cells)


def test_without_a_share_only_tube_currents_are_named(comparison):
    words = said(with_dose(comparison, "pnp", None))
    assert "dose reduction" not in words
    assert "was measured at 20, 80, 320 mA" in words


@pytest.mark.parametrize("method", ["pnp", "fbp-blurred"])
def test_without_a_sum_over_all_lesions_nothing_is_said_about_dose(comparison, method):
    least = tuple(each for each in comparison.least_reductions if each.method != method)
    words = said(replace(comparison, least_reductions=least))
    assert "dose reduction" not in words
    assert "Nothing is said about dose" in words


def test_without_the_control_nothing_is_said_about_dose(comparison):
    alone = with_tasks(comparison, lambda task: None if task.method == "fbp-blurred" else task)
    assert "dose reduction" not in said(alone)
    assert "that of the control is missing" in said(alone)


def test_a_page_without_claims_never_has_the_words(comparison, tmp_path, own_folder):
    write_comparison(own_folder, with_dose(comparison, "pnp", None))
    write_report(own_folder, tmp_path / "report.html")
    assert "dose reduction" not in (tmp_path / "report.html").read_text(encoding="utf-8").lower()


def test_the_table_ends_with_the_share_for_every_lesion(comparison):
    table = equal_dose_table(Results(comparison))
    assert [row.cells[0] for row in table.rows][-2:] == ["every lesion"] * 2
    assert [row.label for row in table.rows][-2:] == ["Blurred FBP (control)", "PnP-ADMM"]
    assert "/least_reductions/1/equal_dose/share/estimate" in table.rows[-1].cells[3]


def test_a_d_prime_without_a_logarithm_is_in_the_table_but_in_no_chart(comparison):
    def negative(task):
        first, *others = task.points
        d_prime = replace(first.found.d_prime, estimate=-0.1, low=-0.4)
        return replace(task, points=(replace(first, found=replace(first.found, d_prime=d_prime)), *others))

    changed = with_tasks(comparison, negative)
    charts = [ElementTree.fromstring(chart.svg) for chart in task_charts(Results(changed))]
    paths = [path.get("d") for chart in charts for path in chart.iter(f"{SVG}path") if path.get("stroke-width") == "2"]
    assert len(paths) == 3 * 3  # observers and lesions, methods
    assert {path.count("L") for path in paths} == {1}  # two points


def test_npwe_is_shown_beside_the_control_only(comparison):
    assert [group.observer for group in groups(Results(comparison))] == ["channelised Hotelling"] * 2 + ["NPWE"]
    alone = with_tasks(
        comparison, lambda task: None if (task.method, task.observer) == ("fbp-blurred", "NPWE") else task
    )
    assert [group.observer for group in groups(Results(alone))] == ["channelised Hotelling"] * 2
    assert left_out(Results(alone)) == 2
    assert left_out(Results(comparison)) == 0
