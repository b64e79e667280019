"""A whole comparison of two scans of water."""

import csv
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from my_methods import plain

from pnpct.comparison import (
    RESULTS,
    Candidates,
    Study,
    compare,
    compare_scans,
    controls,
    read_comparison,
    subjects_of,
    summarise,
)
from pnpct.denoisers import Gaussian
from pnpct.evaluation import body_mask, earth_movers_distance
from pnpct.files import (
    ExposedSlice,
    FileFormatError,
    Provenance,
    read_exposure,
    read_image,
    write_exposures,
    write_scan,
)
from pnpct.geometry import ImageGrid
from pnpct.reconstruction import TVPWLS, PlugAndPlay
from pnpct.simulation import Phantom, clinical_fan_beam, expose, scanner_beam, truth

GRID = ImageGrid(72, 72, spacing=4.0)
OF_EVERY_IMAGE = (
    *("residual chi-square", "residual correlation along views", "residual correlation along bins"),
    *("largest score", "cross-view score", "lesion recovery"),
)
PROVENANCE = Provenance(["test"], "0.1.0")
METHODS = ("fbp", "blurred-fbp", "tv-pwls", "mine", "plain")
STUDY = Study(tube_currents_ma=(100.0, 40.0), phantom_repeats=0, seed=5)


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


def methods(blur: float = 1.5) -> Candidates:
    """Two iterations of each iterative method, and a function."""
    quick = {"tv-pwls": TVPWLS(iterations=2), "mine": PlugAndPlay(Gaussian(0.5), iterations=2), "plain": plain}
    return controls(blur_pixels=blur).with_methods(quick)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("compared")


@pytest.fixture(scope="module")
def comparison(folder: Path, slice_file: Path):
    return compare(folder, [slice_file], methods(), study=STUDY)


def test_every_method_has_an_image_and_its_numbers_in_every_case(comparison, folder: Path) -> None:
    assert tuple(method.name for method in comparison.methods) == METHODS
    assert [case.name for case in comparison.cases] == ["water-40mA", "water-100mA"]
    for case in comparison.cases:
        assert set(case.images) == {*METHODS, "reference", "truth"}
        assert set(comparison.fidelity[case.name]) == {*METHODS, "reference"}
        for name, stored in case.images.items():
            assert read_image(folder / stored.file)[0].shape == GRID.shape, name
    more, less = (comparison.fidelity[case.name]["fbp"]["soft_tissue_rmse_hu"] for case in comparison.cases)
    assert more > 1.02 * less, "a higher dose has less noise"
    hashes = {stored.sha256 for case in comparison.cases for stored in case.images.values()}
    assert len(hashes) == 2 * 7 - 2  # truth and reference are the same at all doses, no two methods are


def test_the_checks_are_there_for_every_image(comparison) -> None:
    asked = {(check.name, check.case, check.method) for check in comparison.checks}
    for case in comparison.cases:
        for name in METHODS:
            for check in OF_EVERY_IMAGE:
                assert (check, case.name, name) in asked
            assert set(case.maps[name]) >= {"t", "verifiable_hu"}
            assert (("error against FBP", case.name, name) in asked) == (name not in ("fbp", "blurred-fbp"))
        assert ("prior-off sweep", case.name, "mine") in asked
        assert set(case.maps["mine"]) == {"t", "verifiable_hu", "difference_hu"}
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
    assert set(comparison.lesions) == {case.name for case in comparison.cases}
    for found in comparison.lesions.values():
        assert tuple(found) == METHODS
        assert 0.4 < found["fbp"].recovered < 1.2
        assert found["blurred-fbp"].recovered < found["fbp"].recovered


def test_what_is_begun_again_reads_its_images_and_finds_the_same(comparison, folder: Path, slice_file: Path) -> None:
    times = {path: path.stat().st_mtime_ns for path in folder.rglob("*.h5")}
    assert compare(folder, [slice_file], methods(), study=STUDY) == comparison
    assert {path: path.stat().st_mtime_ns for path in folder.rglob("*.h5")} == times


def test_images_of_other_settings_are_made_anew(tmp_path: Path, slice_file: Path) -> None:
    study = replace(STUDY, tube_currents_ma=(40.0,), lesion_hu=0.0)
    one, other = (compare(tmp_path, [slice_file], methods(blur), study=study) for blur in (1.5, 3.0))
    assert one.lesions == {}
    assert {check.name for check in one.checks}.isdisjoint({"lesion recovery", "cross-view score"})
    before, after = (each.cases[0].images for each in (one, other))
    assert {name for name in before if before[name].sha256 != after[name].sha256} == {"blurred-fbp"}


def test_what_is_done_is_shown(tmp_path: Path, slice_file: Path) -> None:
    shown = []
    study = replace(STUDY, tube_currents_ma=(40.0,), lesion_hu=0.0)

    def progress(items, total: int, of: str):
        for item in items:
            shown.append((of, total))
            yield item

    compare(tmp_path, [slice_file], {}, study=study, progress=progress)
    assert shown == [("Comparing", 1)]


@pytest.mark.slow
def test_two_processes_find_what_one_does(tmp_path: Path, slice_file: Path, comparison) -> None:
    both = compare(tmp_path, [slice_file], methods(), study=STUDY, processes=2)
    for case in comparison.cases:
        for name in METHODS:
            one, other = (each.fidelity[case.name][name]["body_rmse_hu"] for each in (comparison, both))
            assert one == pytest.approx(other, rel=1e-4)


def test_methods_that_cannot_travel_are_refused_before_the_work(tmp_path: Path, slice_file: Path) -> None:
    with pytest.raises(ValueError, match='"mine" cannot be given to other processes'):
        compare(tmp_path / "out", [slice_file], {"mine": lambda sinogram, A: sinogram}, study=STUDY, processes=2)
    assert not (tmp_path / "out").exists()


def test_the_file_gives_back_what_was_written(comparison, folder: Path, tmp_path: Path) -> None:
    assert read_comparison(folder) == comparison
    content = json.loads((folder / RESULTS).read_text())
    assert content["definitions"]["glcm"]["spec_hash"]
    cases = content.pop("cases")
    (tmp_path / RESULTS).write_text(json.dumps(content))
    with pytest.raises(FileFormatError, match=r"cases"):
        read_comparison(tmp_path)
    for version in (1, 3):
        (tmp_path / RESULTS).write_text(json.dumps({**content, "cases": cases, "format_version": version}))
        with pytest.raises(FileFormatError, match=f"has the format version {version}, and this pnpct reads 2: make"):
            read_comparison(tmp_path)


def test_the_table_has_every_number(comparison, folder: Path) -> None:
    content = json.loads((folder / RESULTS).read_text())
    del content["format"], content["format_version"]
    with (folder / "metrics.csv").open(newline="") as file:
        rows = {row["path"]: row for row in csv.DictReader(file)}
    assert {path: float(row["value"]) if row["value"] else None for path, row in rows.items()} == dict(
        numbers_of(content)
    )
    row = rows["/fidelity/water-40mA/fbp/body_rmse_hu"]
    assert (row["group"], row["case"], row["method"], row["name"]) == ("fidelity", "water-40mA", "fbp", "body_rmse_hu")
    row = rows["/lesions/water-40mA/fbp/recovered"]
    assert (row["group"], row["case"], row["method"], row["name"]) == ("lesions", "water-40mA", "fbp", "recovered")


def numbers_of(content, path: str = "") -> Iterator[tuple[str, float | None]]:
    """Every number of a JSON file, and every null, by its pointer (no name here needs to be escaped)."""
    if isinstance(content, dict | list):
        for key, value in content.items() if isinstance(content, dict) else enumerate(content):
            yield from numbers_of(value, f"{path}/{key}")
    elif content is None or (isinstance(content, int | float) and not isinstance(content, bool)):
        yield path, content


def test_a_scan_without_truth_is_compared_as_far_as_that_goes(tmp_path: Path, slice_file: Path) -> None:
    (drawn,) = subjects_of([slice_file], replace(STUDY, tube_currents_ma=(40.0,)))
    scan = tmp_path / "measured.h5"
    write_scan(scan, drawn.load().scan, provenance=PROVENANCE)
    study = replace(STUDY, size=72)
    (result,) = compare_scans(tmp_path / "out", list(subjects_of([scan], study)), methods(), study)
    found = summarise([result], methods(), study, provenance=PROVENANCE)
    assert found.fidelity == {"measured": {}}
    assert tuple(found.cases[0].images) == METHODS
    assert {check.name for check in found.checks} == {*OF_EVERY_IMAGE, "prior-off sweep"}
    judged = {check.name for check in found.checks if check.verdict != "not judged"}
    assert judged <= {"lesion recovery"}, "nobody knows what beam hardening alone would leave"
    assert found.histogram == {"measured": {}}
    assert found.provenance == PROVENANCE


def test_rows_of_one_patient_are_of_one_patient(tmp_path: Path, slice_file: Path) -> None:
    exposed = read_exposure(slice_file, tube_voltage_kvp=120.0)
    one = ExposedSlice(exposed.exposure, exposed.truth, exposed.grid)
    files = []
    for number, patient in enumerate((3, 3, 4)):
        station = {"source": "chest", "patient": patient}
        files.append(tmp_path / f"chest-row{number}.h5")
        write_exposures(files[-1], {120.0: one}, provenance=replace(PROVENANCE, settings={"station": station}))
    found = subjects_of([*files, slice_file], replace(STUDY, tube_currents_ma=(40.0,)))
    assert [subject.patient for subject in found] == ["chest 3", "chest 3", "chest 4", "water"]


def test_what_cannot_be_compared_is_refused(slice_file: Path, tmp_path: Path) -> None:
    def subjects(*files: Path, **of_study) -> list:
        return list(subjects_of(files, replace(STUDY, **of_study)))

    with pytest.raises(ValueError, match="tube currents"):
        subjects(slice_file, tube_currents_ma=())
    with pytest.raises(ValueError, match="no exposure at 80 kVp"):
        subjects(slice_file, tube_voltage_kvp=80.0)
    with pytest.raises(ValueError, match="Two files are called water"):
        subjects(slice_file, slice_file)
    with pytest.raises(ValueError, match="at least one scan"):
        compare(tmp_path / "none", [], {})
    assert not (tmp_path / "none").exists()
