from dataclasses import replace
from pathlib import Path

import pytest
import torch
from small_phantoms import EDGE, METHODS, PHANTOMS, STUDY

from pnpct.comparison import Candidates, Comparison, Study, controls, phantom_measurements
from pnpct.comparison.dose_tasks import with_phantoms
from pnpct.comparison.phantom_measurements import measure_phantoms, phantom_jobs, reference_kernels
from pnpct.files import Provenance

CURVES = replace(STUDY, phantom_repeats=8, detectability_pairs=0)
EMPTY = Comparison(Provenance([], "0"), {}, (), ())
LINEAR = controls()
"""FBP and its blurred twin; the two other kernels of FBP are measured too."""


def jobs_of(method: str, study: Study):
    return [job for job in phantom_jobs(METHODS, study) if job.method.name == method]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("comparison")


@pytest.fixture(scope="module")
def measured(folder: Path):
    return list(measure_phantoms(folder, phantom_jobs(LINEAR, STUDY)))


def test_every_method_has_a_job_for_curves_and_for_each_dose() -> None:
    kernels = reference_kernels(METHODS)
    assert [each.settings["kernel"] for each in kernels] == ["hann", "ram-lak", "soft"]
    asked = [(job.method.name, job.tube_current_ma) for job in phantom_jobs(METHODS, replace(STUDY, phantom_repeats=2))]
    own = [each.name for each in METHODS]
    doses = {(name, dose) for name in (*own, "fbp+ram-lak", "fbp+soft") for dose in STUDY.doses_ma}
    assert len(asked) == len({*asked})
    assert {*asked} == doses | {(name, None) for name in own}
    assert len(reference_kernels(controls("shepp-logan"))) == 4
    assert phantom_jobs(METHODS, replace(STUDY, detectability_pairs=0)) == ()


def test_what_is_begun_again_reads_its_measurements(folder: Path, measured, monkeypatch) -> None:
    jobs = phantom_jobs(LINEAR, STUDY)
    files = [folder / job.file for job in jobs]
    assert len({*files}) == len(files) == 16
    files[3].unlink()
    files[5].write_text('{"method": "fbp"')
    made = []
    work = phantom_measurements._measure
    monkeypatch.setattr(phantom_measurements, "_measure", lambda where, job: made.append(job.file) or work(where, job))
    again = list(measure_phantoms(folder, jobs))
    assert sorted(made) == sorted(job.file for job in (jobs[3], jobs[5]))
    assert sorted(again, key=str) == sorted(measured, key=str)


def test_a_measurement_is_of_all_it_depends_on() -> None:
    def files(methods: Candidates, study: Study) -> set[str]:
        return {job.file for job in phantom_jobs(methods, study)}

    before = files(LINEAR, STUDY)
    assert len(files(controls(blur_pixels=2.0), STUDY) & before) == len(before) - 4
    assert len(files(LINEAR, replace(STUDY, tube_currents_ma=(60.0, 80.0))) - before) == 4
    changed = [
        replace(STUDY, seed=2),
        replace(STUDY, detectability_pairs=50),
        replace(STUDY, tube_voltage_kvp=100.0),
        replace(STUDY, phantoms=replace(PHANTOMS, bins=130)),
    ]
    for each in changed:
        assert not files(LINEAR, each) & before


def test_a_blur_makes_images_smoother_and_finds_no_more(measured) -> None:
    result = with_phantoms(EMPTY, measured, LINEAR, STUDY)
    by_method = {(task.method, task.observer, task.lesion): task for task in result.tasks}
    assert len(by_method) == 2 * 2 * 2
    lesion = "28 mm, −40 HU"
    plain, blurred = (by_method[name, "channelised Hotelling", lesion].points for name in ("fbp", "blurred-fbp"))
    assert [point.tube_current_ma for point in plain] == [20.0, 60.0, 200.0, 400.0]
    plain, blurred = ([point.found.d_prime.estimate for point in points] for points in (plain, blurred))
    assert plain[-1] > 2 * plain[0]
    assert blurred == pytest.approx(plain, rel=0.25)
    assert [check.name for check in result.checks] == ["blur control"] * 2
    assert with_phantoms(EMPTY, measured[::-1], LINEAR, STUDY) == result


@pytest.mark.slow
def test_two_processes_find_what_one_does(measured, tmp_path: Path) -> None:
    jobs = [job for job in phantom_jobs(LINEAR, STUDY) if job.method.name == "blurred-fbp"]
    found = {each.found[0].tube_current_ma: each for each in measured if each.method == "blurred-fbp"}
    for again in measure_phantoms(tmp_path, jobs, processes=2):
        for one, other in zip(found[again.found[0].tube_current_ma].found, again.found, strict=True):
            d_prime = one.hotelling.d_prime.estimate
            assert other.hotelling.d_prime.estimate == pytest.approx(d_prime, rel=0.02)  # rounding; other noise: 0.1


def test_curves_say_how_far_the_edge_stands_out(folder: Path) -> None:
    (found,) = measure_phantoms(folder, jobs_of("blurred-fbp", CURVES))
    power, transfer = found.curves
    assert (power.kind, transfer.kind) == ("noise-power", "transfer")
    assert transfer.summary["contrast_to_noise"] >= 15
    assert transfer.values[0] == 1.0
    assert found.checks == ()


@pytest.mark.parametrize("contrast", [-1.0, 0.0])
def test_an_edge_in_too_much_noise_gives_no_curve_but_its_ratio(contrast: float, tmp_path: Path) -> None:
    phantoms = replace(PHANTOMS, edge=replace(EDGE, contrast_hu=contrast))
    (found,) = measure_phantoms(tmp_path, jobs_of("fbp", replace(CURVES, phantom_repeats=2, phantoms=phantoms)))
    assert [curve.kind for curve in found.curves] == ["noise-power"]
    (check,) = found.checks
    assert (check.name, check.method) == ("contrast to noise of the edge", "fbp")
    assert (check.low, check.verdict) == (15.0, "not judged")
    assert check.value is not None
    assert check.value < 15


def test_the_noise_does_not_depend_on_how_many_repeats_show_it(tmp_path: Path) -> None:
    few, many = (
        next(measure_phantoms(tmp_path, jobs_of("fbp", replace(CURVES, phantom_repeats=repeats)))).curves[0].summary
        for repeats in (2, 16)
    )
    assert few["noise_hu"] == pytest.approx(many["noise_hu"], rel=0.08)  # two would show 20 % less by their mean error


def flat(sinogram, A) -> torch.Tensor:
    """Water everywhere."""
    return torch.ones(len(sinogram.line_integrals), *A.grid.shape)


def test_a_method_that_shows_no_noise_is_said_to_be_so(tmp_path: Path) -> None:
    methods = LINEAR.with_methods({"flat": flat})
    jobs = [job for job in phantom_jobs(methods, STUDY) if job.method.name == "flat"]
    found = list(measure_phantoms(tmp_path, jobs))
    assert [each.found for each in found] == [()] * 4
    (check,) = found[0].checks
    assert (check.name, check.verdict) == ("detectability", "not judged")
    assert "no observer could be trained" in check.says
    assert with_phantoms(EMPTY, found, methods, STUDY).least_reductions == ()
