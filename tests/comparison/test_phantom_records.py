from dataclasses import replace
from pathlib import Path

import pytest
from small_phantoms import EDGE, PHANTOMS, TESTS, small_plan

from pnpct.comparison import Plan, measure_phantoms, phantom_jobs, phantom_records, phantom_results
from pnpct.comparison.phantom_records import phantom_candidates

CURVES = replace(TESTS, repeats=8, pairs=0)


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> Plan:
    return small_plan(tmp_path_factory.mktemp("networks"))


def jobs_of(plan: Plan, tests, *places: int):
    return [job for job in phantom_jobs(plan, tests) if job.place in places]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("comparison")


@pytest.fixture(scope="module")
def records(folder: Path, plan: Plan):
    """FBP, its blurred twin, and FBP with the two other kernels, at four doses each."""
    return list(measure_phantoms(folder, jobs_of(plan, TESTS, 0, 1, 7, 8)))


def test_every_method_has_a_job_for_curves_and_for_each_dose(plan: Plan) -> None:
    kernels = [candidate.method.settings.get("kernel") for candidate in phantom_candidates(plan)]
    assert kernels == ["hann", *[None] * 6, "ram-lak", "soft"]
    asked = {(job.place, job.tube_current_ma) for job in phantom_jobs(plan, replace(TESTS, repeats=2))}
    doses = {(place, dose) for place in range(9) for dose in TESTS.doses_ma}
    assert asked == doses | {(place, None) for place in range(7)}
    other = phantom_candidates(replace(plan, kernel="shepp-logan"))
    assert len(other) == 10
    assert phantom_jobs(plan, replace(TESTS, pairs=0)) == ()
    with pytest.raises(ValueError, match="A seed is a whole number from 0, got -1"):
        phantom_jobs(replace(plan, seed=-1), TESTS)


def test_what_is_begun_again_reads_its_records(folder: Path, records, plan: Plan, monkeypatch) -> None:
    jobs = jobs_of(plan, TESTS, 0, 1, 7, 8)
    files = [folder / job.file for job in jobs]
    assert len({*files}) == len(files) == len([*(folder / "phantoms").iterdir()]) == 16
    files[3].unlink()
    files[5].write_text('{"place": 0')
    made = []
    work = phantom_records._measure
    monkeypatch.setattr(phantom_records, "_measure", lambda where, job: made.append(job.file) or work(where, job))
    again = list(measure_phantoms(folder, jobs))
    assert sorted(made) == sorted(job.file for job in (jobs[3], jobs[5]))
    assert sorted(again, key=str) == sorted(records, key=str)


def test_a_record_is_of_all_it_depends_on(plan: Plan, tmp_path: Path) -> None:
    def files(plan: Plan, tests) -> set[str]:
        return {job.file for job in phantom_jobs(plan, tests)}

    before = files(plan, TESTS)
    assert files(small_plan(tmp_path), TESTS) != before, "other networks"
    assert len(files(replace(plan, blur_pixels=2.0), TESTS) & before) == len(before) - 4
    assert len(files(plan, replace(TESTS, tube_currents_ma=(60.0, 80.0))) - before) == 9
    changed = [
        (replace(plan, seed=2), TESTS),
        (plan, replace(TESTS, pairs=50)),
        (plan, replace(TESTS, tube_voltage_kvp=100.0)),
        (plan, replace(TESTS, phantoms=replace(PHANTOMS, bins=130))),
    ]
    for each in changed:
        assert not files(*each) & before


def test_a_blur_makes_images_smoother_and_finds_no_more(records, plan: Plan) -> None:
    result = phantom_results(records, plan, TESTS)
    by_method = {(task.method, task.observer, task.lesion): task for task in result.tasks}
    assert len(by_method) == 2 * 2 * 2
    lesion = "28 mm, −40 HU"
    plain, blurred = (by_method[name, "channelised Hotelling", lesion].points for name in ("fbp", "blurred-fbp"))
    assert [point.tube_current_ma for point in plain] == [20.0, 60.0, 200.0, 400.0]
    assert plain[-1].d_prime > 2 * plain[0].d_prime
    for one, other in zip(plain, blurred, strict=True):
        assert other.d_prime == pytest.approx(one.d_prime, rel=0.35)
    assert [check.name for check in result.checks] == ["blur control"] * 2
    shuffled = phantom_results(records[::-1], plan, TESTS)
    assert shuffled == result


@pytest.mark.slow
def test_two_processes_find_what_one_does(records, plan: Plan, tmp_path: Path) -> None:
    both = list(measure_phantoms(tmp_path, jobs_of(plan, TESTS, 1), processes=2))
    expected = phantom_results([record for record in records if record.place == 1], plan, TESTS).tasks
    for one, other in zip(expected, phantom_results(both, plan, TESTS).tasks, strict=True):
        for point, again in zip(one.points, other.points, strict=True):
            assert again.d_prime == pytest.approx(point.d_prime, rel=0.02)  # rounding; other noise: 0.1


def test_curves_say_how_far_the_edge_stands_out(folder: Path, plan: Plan) -> None:
    (record,) = measure_phantoms(folder, jobs_of(plan, CURVES, 1))
    power, transfer = record.curves
    assert (power.kind, transfer.kind) == ("noise-power", "transfer")
    assert transfer.summary["contrast_to_noise"] >= 15
    assert transfer.values[0] == 1.0
    assert record.checks == ()


@pytest.mark.parametrize("contrast", [-1.0, 0.0])
def test_an_edge_in_too_much_noise_gives_no_curve_but_its_ratio(contrast: float, plan: Plan, tmp_path: Path) -> None:
    faint = replace(CURVES, repeats=2, phantoms=replace(PHANTOMS, edge=replace(EDGE, contrast_hu=contrast)))
    (record,) = measure_phantoms(tmp_path, jobs_of(plan, faint, 0))
    assert [curve.kind for curve in record.curves] == ["noise-power"]
    (check,) = record.checks
    assert (check.name, check.method, check.low, check.verdict) == (
        "contrast to noise of the edge",
        "fbp",
        15.0,
        "not judged",
    )
    assert check.value is not None
    assert check.value < 15


def test_the_noise_does_not_depend_on_how_many_repeats_show_it(plan: Plan, tmp_path: Path) -> None:
    few, many = (
        next(measure_phantoms(tmp_path, jobs_of(plan, replace(CURVES, repeats=repeats), 0))).curves[0].summary
        for repeats in (2, 16)
    )
    assert few["noise_hu"] == pytest.approx(many["noise_hu"], rel=0.08)  # two would show 20 % less by their mean error


def test_a_method_that_shows_no_noise_is_said_to_be_so(plan: Plan, tmp_path: Path, monkeypatch) -> None:
    first, *others = phantom_candidates(plan)
    constant = replace(first, make=lambda sinogram, A: 0 * first.make(sinogram, A) + 1)
    monkeypatch.setattr(phantom_records, "phantom_candidates", lambda plan: (constant, *others))
    found = list(measure_phantoms(tmp_path, jobs_of(plan, TESTS, 0)))
    assert [record.found for record in found] == [()] * 4
    (check,) = found[0].checks
    assert (check.name, check.verdict) == ("detectability", "not judged")
    assert "no observer could be trained" in check.says
    assert phantom_results(found, plan, TESTS).least_reductions == ()
