"""A saving of dose is spoken of only with task, observer, reference kernel, interval and control."""

from dataclasses import replace

import msgspec
import pytest
from small_comparison import make_comparison

from pnpct.comparison import Comparison, DoseShare
from pnpct.report import write_report
from pnpct.report.dose_words import dose_statements
from pnpct.report.marked_numbers import Numbers
from pnpct.report.task_charts import groups, left_out


@pytest.fixture(scope="module")
def comparison(tmp_path_factory) -> Comparison:
    return make_comparison(tmp_path_factory.mktemp("dose"))


def said(comparison: Comparison) -> str:
    return " ".join(dose_statements(comparison, Numbers(msgspec.to_builtins(comparison))))


def with_tasks(comparison: Comparison, change) -> Comparison:
    return replace(comparison, tasks=tuple(task for old in comparison.tasks if (task := change(old)) is not None))


def of_pnp(dose):
    return lambda task: replace(task, equal_dose=dose) if task.method == "pnp" and task.equal_dose else task


def test_the_whole_claim_has_task_observer_reference_interval_and_control(comparison):
    words = said(comparison)
    for part in ("10 mm, −15 HU", "channelised Hotelling", "FBP hann at 320 mA", "95 % interval", "Blurred FBP"):
        assert part in words
    for number in (">64.0<", ">55.0<", ">73.0<", ">97.0<"):
        assert number in words
    assert "dose reduction" in words


def test_the_least_favourable_lesion_is_the_one_that_counts(comparison):
    worse = DoseShare("FBP hann at 320 mA", 0.8, 0.75, 0.85)
    changed = with_tasks(
        comparison,
        lambda task: replace(task, equal_dose=worse) if (task.method, task.lesion[0]) == ("pnp", "5") else task,
    )
    assert "5 mm, −30 HU" in said(changed)
    assert ">80.0<" in said(changed)


@pytest.mark.parametrize(
    "dose",
    [
        None,
        DoseShare("FBP hann at 320 mA", None, None, None),
        DoseShare("FBP hann at 320 mA", 0.64, None, 0.73),
        DoseShare("FBP hann at 320 mA", 0.64, 0.55, None),
    ],
    ids=["no share", "outside the doses", "no lower end", "no upper end"],
)
def test_without_a_share_or_its_interval_only_tube_currents_are_named(comparison, dose):
    words = said(with_tasks(comparison, of_pnp(dose)))
    assert "dose reduction" not in words
    assert "was measured at 20, 80, 320 mA" in words


def test_without_the_control_nothing_is_said_about_dose(comparison):
    alone = with_tasks(comparison, lambda task: None if task.method == "fbp-blurred" else task)
    assert "dose reduction" not in said(alone)
    assert "that of the control is missing" in said(alone)


@pytest.mark.parametrize("high", [1.0, 1.2, 0.98])
def test_no_saving_is_claimed_where_the_interval_reaches_all_or_the_control(comparison, high):
    words = said(with_tasks(comparison, of_pnp(DoseShare("FBP hann at 320 mA", 0.9, 0.8, high))))
    assert "dose reduction" not in words
    assert "No saving is shown" in words


def test_a_page_without_claims_never_has_the_words(comparison, tmp_path, own_folder):
    from pnpct.comparison import write_comparison

    write_comparison(own_folder, with_tasks(comparison, of_pnp(None)))
    write_report(own_folder, tmp_path / "report.html")
    assert "dose reduction" not in (tmp_path / "report.html").read_text(encoding="utf-8").lower()


def test_npwe_is_shown_beside_the_control_only(comparison):
    assert [group.observer for group in groups(comparison)] == ["channelised Hotelling"] * 2 + ["NPWE"]
    alone = with_tasks(
        comparison, lambda task: None if (task.method, task.observer) == ("fbp-blurred", "NPWE") else task
    )
    assert [group.observer for group in groups(alone)] == ["channelised Hotelling"] * 2
    assert left_out(alone) == 2
    assert left_out(comparison) == 0
