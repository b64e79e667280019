import csv
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from pnpct.comparison import (
    RESULTS,
    Plan,
    compare_cases,
    read_comparison,
    subjects_of,
    summarise,
    write_comparison,
    write_table,
)
from pnpct.denoisers import RDNCBAM, RDNSize
from pnpct.evaluation import body_mask, earth_movers_distance
from pnpct.files import (
    ExposedSlice,
    FileFormatError,
    Provenance,
    read_exposure,
    read_image,
    save_network,
    sha256_of,
    write_exposures,
    write_scan,
)
from pnpct.geometry import ImageGrid
from pnpct.simulation import Phantom, clinical_fan_beam, expose, scanner_beam, truth

GRID = ImageGrid(72, 72, spacing=4.0)
OF_EVERY_IMAGE = (
    *("residual chi-square", "residual correlation along views", "residual correlation along bins"),
    *("largest score", "cross-view score", "lesion recovery"),
)
PROVENANCE = Provenance(["test"], "0.1.0")
METHODS = ["fbp", "blurred-fbp", "tv-pwls", "supervised", "two-stage", "pnp-supervised", "pnp-two-stage"]


@pytest.fixture(scope="module")
def slice_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    fan = clinical_fan_beam(views=60, bins=120)
    fine = ImageGrid(144, 144, spacing=2.0)
    x, y = torch.from_numpy(fine.x).float(), torch.from_numpy(fine.y).float()[:, None]
    water = ((x / 120) ** 2 + (y / 90) ** 2 < 1).float()
    phantom = Phantom(("air", "water"), torch.stack([1 - water, water]), fine)
    beam = scanner_beam(fan, tube_voltage_kvp=120.0)
    exposed = ExposedSlice(expose(phantom, fan, beam), truth(phantom, GRID, energy=beam.effective_energy), GRID)
    path = tmp_path_factory.mktemp("comparison") / "water.h5"
    write_exposures(path, {120.0: exposed}, provenance=PROVENANCE)
    return path


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> Plan:
    folder = tmp_path_factory.mktemp("networks")
    about = {"command": [], "licence": "Apache-2.0", "manifest_sha256": "0" * 64, "metrics": {}, "seed": 0}
    names = []
    for seed in (1, 2):
        torch.manual_seed(seed)
        network = RDNCBAM(RDNSize(features=4, growth=4, blocks=1, convolutions=2))
        with torch.no_grad():
            for parameter in network.parameters():
                parameter.add_(0.001 * torch.randn_like(parameter))  # untrained networks return their input
        names.append(str(folder / f"{seed}.safetensors"))
        save_network(Path(names[-1]), network, about=about)
    return Plan(supervised=names[0], two_stage=names[1], iterations=2, seed=5)


def compared(folder: Path, slice_file: Path, plan: Plan, *, processes: int = 1):
    subjects = list(subjects_of([slice_file], tube_currents_ma=[100.0, 40.0], tube_voltage_kvp=120.0, seed=plan.seed))
    found = {one.case.name: one for one in compare_cases(folder, subjects, plan, processes=processes)}
    return summarise([found[subject.name] for subject in subjects], plan, provenance=PROVENANCE)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("compared")


@pytest.fixture(scope="module")
def comparison(folder: Path, slice_file: Path, plan: Plan):
    return compared(folder, slice_file, plan)


def test_every_method_has_an_image_and_its_numbers_in_every_case(comparison, folder: Path) -> None:
    assert [method.name for method in comparison.methods] == METHODS
    assert [case.name for case in comparison.cases] == ["water-40mA", "water-100mA"]
    for case in comparison.cases:
        assert set(case.images) == {*METHODS, "reference", "truth"}
        assert set(comparison.fidelity[case.name]) == {*METHODS, "reference"}
        for name, stored in case.images.items():
            assert read_image(folder / stored.file)[0].shape == GRID.shape, name
    more, less = (comparison.fidelity[case.name]["fbp"]["soft_tissue_rmse_hu"] for case in comparison.cases)
    assert more > 1.02 * less, "a higher dose has less noise"
    hashes = {stored.sha256 for case in comparison.cases for stored in case.images.values()}
    assert len(hashes) == 2 * 9 - 2  # truth and reference are the same at all doses, no two methods are


def test_the_checks_are_there_for_every_image(comparison) -> None:
    asked = {(check.name, check.case, check.method) for check in comparison.checks}
    for case in comparison.cases:
        for name in METHODS:
            for check in OF_EVERY_IMAGE:
                assert (check, case.name, name) in asked
            assert set(case.maps[name]) >= {"t", "verifiable_hu"}
            assert (("error against FBP", case.name, name) in asked) == (name not in ("fbp", "blurred-fbp"))
        assert ("prior-off sweep", case.name, "pnp-two-stage") in asked
        assert set(case.maps["pnp-two-stage"]) == {"t", "verifiable_hu", "difference_hu"}
        assert case.disc_mm == 8.0
    blur = [each for each in comparison.checks if each.method == "blurred-fbp" and each.name == "residual chi-square"]
    assert {check.verdict for check in blur} == {"fail"}


def test_grey_values_are_compared_with_the_reference_scan_and_with_the_truth(comparison, folder: Path) -> None:
    for case in comparison.cases:
        found = comparison.histogram[case.name]
        assert set(found) == {*METHODS, "reference", "repeat", "truth"}
        reference, truth = (read_image(folder / case.images[name].file)[0] for name in ("reference", "truth"))
        fbp, _ = read_image(folder / case.images["fbp"].file)
        body = body_mask(truth)
        assert found["fbp"]["emd"] == earth_movers_distance(fbp, reference, mask=body)
        assert found["fbp"]["emd_to_truth"] == earth_movers_distance(fbp, truth, mask=body)
        # Both are distances from the first scan at 800 mA, so that one may be read against the other.
        assert found["repeat"]["emd"] == found["reference"]["repeat_scan_floor"]


def test_linear_methods_keep_a_lesion_as_far_as_their_blur_lets_them(comparison) -> None:
    kept = {(one.case, one.method): one.recovered for one in comparison.lesions}
    assert len(kept) == 2 * len(METHODS)
    for case in comparison.cases:
        assert 0.4 < kept[case.name, "fbp"] < 1.2
        assert kept[case.name, "blurred-fbp"] < kept[case.name, "fbp"]


def test_what_is_begun_again_reads_its_images_and_finds_the_same(
    comparison, folder: Path, slice_file: Path, plan: Plan
) -> None:
    times = {path: path.stat().st_mtime_ns for path in folder.rglob("*.h5")}
    assert compared(folder, slice_file, plan) == comparison
    assert {path: path.stat().st_mtime_ns for path in folder.rglob("*.h5")} == times


def test_images_of_other_settings_are_made_anew(tmp_path: Path, slice_file: Path, plan: Plan, comparison) -> None:
    one = compared(tmp_path, slice_file, replace(plan, lesion_hu=0.0))
    assert one.lesions == ()
    assert {check.name for check in one.checks}.isdisjoint({"lesion recovery", "cross-view score"})
    other = compared(tmp_path, slice_file, replace(plan, lesion_hu=0.0, blur_pixels=3.0))
    for case in one.cases:
        before, after = (each.images for each in (case, next(c for c in other.cases if c.name == case.name)))
        assert {name for name in before if before[name].sha256 != after[name].sha256} == {"blurred-fbp"}


@pytest.mark.slow
def test_two_processes_find_what_one_does(tmp_path: Path, slice_file: Path, plan: Plan, comparison) -> None:
    both = compared(tmp_path, slice_file, plan, processes=2)
    for case in comparison.cases:
        for name in METHODS:
            one, other = (each.fidelity[case.name][name]["body_rmse_hu"] for each in (comparison, both))
            assert one == pytest.approx(other, rel=1e-4)


def test_the_file_gives_back_what_was_written(comparison, tmp_path: Path) -> None:
    write_comparison(tmp_path, comparison)
    assert read_comparison(tmp_path) == comparison
    content = json.loads((tmp_path / RESULTS).read_text())
    assert content["definitions"]["glcm"]["spec_hash"]
    del content["cases"]
    (tmp_path / RESULTS).write_text(json.dumps(content))
    with pytest.raises(FileFormatError, match=r"cases"):
        read_comparison(tmp_path)


def test_the_table_has_every_number(comparison, tmp_path: Path) -> None:
    write_comparison(tmp_path, comparison)
    write_table(tmp_path, comparison)
    content = json.loads((tmp_path / RESULTS).read_text())
    del content["format"], content["format_version"]
    with (tmp_path / "metrics.csv").open(newline="") as file:
        rows = {row["path"]: row for row in csv.DictReader(file)}
    assert {path: float(row["value"]) if row["value"] else None for path, row in rows.items()} == dict(
        numbers_of(content)
    )
    row = rows["/fidelity/water-40mA/fbp/body_rmse_hu"]
    assert (row["group"], row["case"], row["method"], row["name"]) == ("fidelity", "water-40mA", "fbp", "body_rmse_hu")


def numbers_of(content, path: str = "") -> Iterator[tuple[str, float | None]]:
    """Every number of a JSON file, and every null, by its pointer (no name here needs to be escaped)."""
    if isinstance(content, dict | list):
        for key, value in content.items() if isinstance(content, dict) else enumerate(content):
            yield from numbers_of(value, f"{path}/{key}")
    elif content is None or (isinstance(content, int | float) and not isinstance(content, bool)):
        yield path, content


def test_a_scan_without_truth_is_compared_as_far_as_that_goes(tmp_path: Path, slice_file: Path, plan: Plan) -> None:
    (drawn, _) = subjects_of([slice_file], tube_currents_ma=[100.0, 40.0], tube_voltage_kvp=120.0, seed=1)
    scan = tmp_path / "measured.h5"
    write_scan(scan, drawn.load().scan, provenance=PROVENANCE)
    subjects = list(subjects_of([scan], tube_currents_ma=[], tube_voltage_kvp=120.0, seed=1, size=72))
    results = list(compare_cases(tmp_path / "out", subjects, plan))
    found = summarise(results, plan, provenance=PROVENANCE)
    assert found.fidelity == {"measured": {}}
    assert set(found.cases[0].images) == set(METHODS)
    assert {check.name for check in found.checks} == {*OF_EVERY_IMAGE, "prior-off sweep"}
    judged = {check.name for check in found.checks if check.verdict != "not judged"}
    assert judged <= {"lesion recovery"}, "nobody knows what beam hardening alone would leave"
    assert found.histogram == {"measured": {}}
    assert found.provenance == PROVENANCE
    assert sha256_of(scan)


def test_rows_of_one_patient_are_of_one_patient(tmp_path: Path, slice_file: Path) -> None:
    exposed = read_exposure(slice_file, tube_voltage_kvp=120.0)
    one = ExposedSlice(exposed.exposure, exposed.truth, exposed.grid)
    files = []
    for number, patient in enumerate((3, 3, 4)):
        station = {"source": "chest", "patient": patient}
        files.append(tmp_path / f"chest-row{number}.h5")
        write_exposures(files[-1], {120.0: one}, provenance=replace(PROVENANCE, settings={"station": station}))
    found = subjects_of([*files, slice_file], tube_currents_ma=[40.0], tube_voltage_kvp=120.0, seed=0)
    assert [subject.patient for subject in found] == ["chest 3", "chest 3", "chest 4", "water"]


def test_what_cannot_be_compared_is_refused(slice_file: Path, tmp_path: Path, plan: Plan) -> None:
    def subjects(*files: Path, currents: list[float], voltage: float = 120.0) -> list:
        return list(subjects_of(files, tube_currents_ma=currents, tube_voltage_kvp=voltage, seed=0))

    with pytest.raises(ValueError, match="tube currents"):
        subjects(slice_file, currents=[])
    with pytest.raises(ValueError, match="no exposure at 80 kVp"):
        subjects(slice_file, currents=[40.0], voltage=80.0)
    with pytest.raises(ValueError, match="Two files are called water"):
        subjects(slice_file, slice_file, currents=[40.0])
    with pytest.raises(ValueError, match="at least one scan"):
        list(compare_cases(tmp_path / "none", [], plan))
    assert not (tmp_path / "none").exists()
