"""Measurements whose d′ is chosen, so that the answer is known."""

import math
from dataclasses import replace

import pytest
from small_phantoms import INSERTS, METHODS, STUDY

from pnpct.comparison import Comparison
from pnpct.comparison.dose_tasks import with_phantoms
from pnpct.comparison.phantom_measurements import PhantomMeasurement
from pnpct.evaluation import InsertDetectability, Interval
from pnpct.evaluation.observers.model_observers import Detectability
from pnpct.files import Provenance

SMALL, LARGE = INSERTS
FBP, BLUR, TV, RAM_LAK, SOFT = "fbp", "blurred-fbp", "tv-pwls", "fbp+ram-lak", "fbp+soft"
ALIKE = dict.fromkeys((FBP, BLUR, TV, "other", RAM_LAK, SOFT), 1.0)
EMPTY = Comparison(Provenance([], "0"), {}, (), ())


def judged(d: float, error: float) -> Detectability:
    return Detectability(Interval(d, d - 1.96 * error, d + 1.96 * error, error, 0.95), auc=0.9, pairs=40)


def results(gains, *, error: float = 0.02, broken=()) -> Comparison:
    """Give every method a share of the dose that it uses: d′ = √(gain · mA) / 10 for each insert."""
    measured = []
    for method, gain in gains.items():
        for current in STUDY.doses_ma:
            found = []
            for insert in INSERTS:
                of_insert = gain[INSERTS.index(insert)] if isinstance(gain, tuple) else gain
                d = 0.1 * math.sqrt(of_insert * current)
                one = judged(-0.1 if (method, insert, current) in broken else d, error * d)
                found.append(InsertDetectability(insert, current, one, one, contrast_hu=-40.0, noise_hu=10.0))
            measured.append(PhantomMeasurement(method, found=tuple(found)))
    return with_phantoms(EMPTY, measured, METHODS, STUDY)


def shares(found: Comparison, method: str):
    tasks = (task for task in found.tasks if task.method == method and task.observer == "channelised Hotelling")
    return {task.lesion: task.equal_dose for task in tasks}


def least(found: Comparison, method: str):
    return next(each for each in found.least_reductions if each.method == method)


def test_the_mark_is_that_of_the_best_kernel_at_200_ma() -> None:
    found = results({**ALIKE, SOFT: (1.5, 1.0), RAM_LAK: (0.5, 1.25)})
    small, large = shares(found, "fbp").values()
    assert (small.reference, large.reference) == ("FBP soft at 200 mA", "FBP ram-lak at 200 mA")
    assert small.share.estimate == pytest.approx(1.5, rel=1e-6)
    assert large.share.estimate == pytest.approx(1.25, rel=1e-6)
    assert small.outside is large.outside is None, "doses beyond the full one were measured"


def test_a_method_that_is_no_better_is_found_between_the_doses() -> None:
    for share in shares(results(ALIKE), "tv-pwls").values():
        assert share.share.estimate == pytest.approx(1.0)
        assert share.share.low < 1 < share.share.high
        assert share.outside is None


@pytest.mark.parametrize(("gain", "outside", "bound"), [(0.1, "above", 2.0), (100.0, "below", 0.1)])
def test_the_side_is_kept_where_the_dose_was_not_measured(gain: float, outside: str, bound: float) -> None:
    found = results({**ALIKE, TV: gain})
    for share in (*shares(found, "tv-pwls").values(), least(found, "tv-pwls").equal_dose):
        assert share.outside == outside
        assert share.share.estimate == pytest.approx(bound)


def test_what_is_saved_is_what_the_least_favourable_lesion_allows() -> None:
    found = results({**ALIKE, TV: (4.0, 1.25)})
    one = least(found, "tv-pwls")
    assert one.lesion == "28 mm, −40 HU"
    assert one.equal_dose.share.estimate == pytest.approx(0.8)
    assert {each.method for each in found.least_reductions} >= {"fbp", "blurred-fbp", "tv-pwls"}


def test_the_interval_of_the_least_is_no_lower_than_that_of_any_lesion() -> None:
    found = results({**ALIKE, TV: (1.3, 1.25)}, error=0.2)
    one = least(found, "tv-pwls").equal_dose.share
    of_each = [each.share for each in shares(found, "tv-pwls").values()]
    assert one.high >= max(share.high for share in of_each) - 0.05
    assert one.low > max(share.low for share in of_each)


def test_a_d_prime_that_is_not_positive_leaves_out_its_dose_and_the_sum_of_all() -> None:
    found = results({**ALIKE, TV: 2.0}, broken={(TV, SMALL, 20.0)})
    small, large = shares(found, "tv-pwls").values()
    assert small is None
    assert large.share.estimate == pytest.approx(0.5)
    assert "tv-pwls" not in {each.method for each in found.least_reductions}
    (points,) = (task.points for task in found.tasks if (task.method, task.lesion) == ("tv-pwls", "20 mm, −60 HU"))
    assert points[0].found.d_prime.estimate == -0.1, "the number is kept"


def test_a_lesion_that_no_kernel_finds_has_no_mark() -> None:
    found = results(ALIKE, broken={(place, LARGE, 20.0) for place in (FBP, RAM_LAK, SOFT)})
    for method in ("fbp", "blurred-fbp", "tv-pwls"):
        small, large = shares(found, method).values()
        assert small is not None
        assert large is None
    assert found.least_reductions == ()
    one_left = results(ALIKE, broken={(place, LARGE, 20.0) for place in (FBP, RAM_LAK)})
    assert shares(one_left, "tv-pwls")["28 mm, −40 HU"].reference == "FBP soft at 200 mA"


@pytest.mark.parametrize(
    ("gain", "error", "verdict"),
    [
        (1.0, 0.02, "pass"),
        (1.1, 0.02, "pass"),
        (2.0, 0.02, "fail"),
        (0.6, 0.02, "fail"),
        (100.0, 0.02, "fail"),
        (1.3, 0.3, "not judged"),
    ],
)
def test_the_control_may_need_neither_much_less_nor_much_more(gain: float, error: float, verdict: str) -> None:
    checks = results({**ALIKE, BLUR: gain}, error=error).checks
    assert [check.name for check in checks] == ["blur control"] * 2
    for check in checks:
        assert (check.method, check.low, check.high, check.verdict) == ("blurred-fbp", 0.85, 1.15, verdict)
        assert ("more pairs" in check.says) == (verdict == "not judged")


def test_a_control_that_could_not_be_measured_is_not_judged() -> None:
    small, large = results(ALIKE, broken={(BLUR, SMALL, 60.0)}).checks
    assert (small.verdict, small.value, large.verdict) == ("not judged", None, "pass")


def test_the_observer_that_a_blur_fools_is_kept_of_fbp_and_the_control_alone() -> None:
    found = results(ALIKE)
    npwe = [task for task in found.tasks if task.observer == "NPWE"]
    assert {task.method for task in npwe} == {"fbp", "blurred-fbp"}
    assert all(task.equal_dose is None for task in npwe)
    assert len({task.method for task in found.tasks}) == 4, "the other kernels are no methods"


def test_without_phantoms_there_is_nothing() -> None:
    assert with_phantoms(EMPTY, [], METHODS, replace(STUDY, detectability_pairs=0)) == EMPTY
