import hashlib
import os
import shutil
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from pnpct.files import read_exposure, read_manifest, sha256_of, write_manifest
from pnpct.simulation import Recipe, Simulator, clinical_fan_beam, plan, procedural_patient, simulate_dataset

SMALL = Recipe(anatomies=("head",), cases=3, rows=2, tube_voltages_kvp=(80.0, 120.0), views=12, bins=40, size=32)


def fingerprints(folder: Path) -> dict[str, str]:
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("data") / "set"
    assert len(list(simulate_dataset(folder, SMALL))) == 3
    return folder


def test_patients_are_split_and_every_slice_is_listed_with_its_hash(made: Path) -> None:
    manifest = read_manifest(made)
    assert sorted(scan.split for scan in manifest.scans) == ["test", "train", "validation"]
    listed = {name: digest for scan in manifest.scans for name, digest in scan.files.items()}
    assert len(listed) == 6
    assert all(sha256_of(made / name) == digest for name, digest in listed.items())
    assert set(fingerprints(made)) == {*listed, "manifest.json"}
    heights = np.array([scan.z_mm for scan in manifest.scans])
    np.testing.assert_allclose(np.diff(heights, axis=1), 0.625)


def test_slices_hold_exposures_at_all_voltages_with_the_truth(made: Path) -> None:
    (name, *_) = read_manifest(made).files("train")
    low, high = (read_exposure(made / name, tube_voltage_kvp=voltage) for voltage in (80.0, 120.0))
    assert low.exposure.moments.signal_mean.shape == (12, 40)
    assert low.truth is not None
    assert high.truth is not None
    # Bone attenuates low energies more than water does.
    assert low.truth.max() > high.truth.max()
    generator = torch.Generator().manual_seed(0)
    assert low.exposure.scan(tube_current_ma=40.0, generator=generator).counts.min() < 2e5


@pytest.mark.parametrize("simulator", ["own", "catsim"])
def test_a_blurred_scanner_scans_the_same_patients_less_sharply(simulator: Simulator, tmp_path: Path) -> None:
    if simulator == "catsim":
        pytest.importorskip("gecatsim", reason="CatSim is not installed")
    one = replace(SMALL, cases=1, rows=1, tube_voltages_kvp=(120.0,), simulator=simulator, test=0, validation=0)
    for blur in (False, True):
        assert len(list(simulate_dataset(tmp_path / str(blur), replace(one, blur=blur)))) == 1
    for name in read_manifest(tmp_path / "True").files("train"):
        sharp, blurred = (read_exposure(tmp_path / str(blur) / name, tube_voltage_kvp=120.0) for blur in (False, True))
        assert sharp.truth is not None
        assert blurred.truth is not None
        assert torch.equal(blurred.truth, sharp.truth)
        less, more = (torch.log(each.exposure.moments.signal_mean).diff(n=2).norm() for each in (blurred, sharp))
        assert 0.5 * more < less < 0.995 * more


def test_an_interrupted_run_continues_and_its_bytes_are_those_of_an_uninterrupted_one(
    made: Path, tmp_path: Path
) -> None:
    folder = shutil.copytree(made, tmp_path / "set")
    first, second, third = read_manifest(made).scans
    write_manifest(folder, replace(read_manifest(made), scans=[first]))
    (folder / next(iter(second.files))).write_bytes(b"half")
    shutil.rmtree(folder / third.split)
    then = {name: (folder / name).stat().st_mtime_ns for name in first.files}
    assert len(list(simulate_dataset(folder, SMALL))) == 3
    assert fingerprints(folder) == fingerprints(made)
    assert {name: (folder / name).stat().st_mtime_ns for name in first.files} == then


def test_a_damaged_file_is_made_again_and_others_are_not(made: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(made, tmp_path / "set")
    damaged, untouched = (folder / read_manifest(folder).files(split)[0] for split in ("train", "test"))
    then = untouched.stat().st_mtime_ns
    damaged.write_bytes(damaged.read_bytes()[:100])
    assert len(list(simulate_dataset(folder, SMALL))) == 3
    assert fingerprints(folder) == fingerprints(made)
    assert untouched.stat().st_mtime_ns == then


@pytest.mark.slow
def test_two_processes_make_the_same_bytes_as_one(made: Path, tmp_path: Path) -> None:
    assert len(list(simulate_dataset(tmp_path / "set", SMALL, processes=2))) == 3
    assert fingerprints(tmp_path / "set") == fingerprints(made)


def test_another_recipe_or_another_folder_is_left_alone(made: Path, tmp_path: Path) -> None:
    other = Recipe(**{**vars(SMALL), "seed": 5})
    with pytest.raises(ValueError, match=r"another recipe \(seed\)"):
        list(simulate_dataset(made, other))
    (tmp_path / "thesis.txt").write_text("all of it")
    with pytest.raises(ValueError, match="not a data set"):
        list(simulate_dataset(tmp_path, SMALL))
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]


def test_the_plan_keeps_all_scans_of_a_patient_together_and_depends_on_the_seed() -> None:
    recipe = Recipe(anatomies=("chest",), cases=20, stations=3, validation=0.2, test=0.1)
    stations = plan(recipe)
    assert len(stations) == 60
    of_patient: dict[int, set[str]] = {}
    for station in stations:
        of_patient.setdefault(station.patient, set()).add(station.split)
    assert all(len(splits) == 1 for splits in of_patient.values())
    splits = [next(iter(of_patient[number])) for number in range(20)]
    assert [splits.count(name) for name in ("train", "validation", "test")] == [14, 4, 2]
    shares = [station.share for station in stations[:3]]
    assert all(number / 3 <= share <= (number + 1) / 3 for number, share in enumerate(shares))
    assert plan(recipe) == stations
    assert plan(Recipe(**{**vars(recipe), "seed": 1})) != stations


def test_patients_of_other_sizes_are_the_same_patients_larger_or_smaller() -> None:
    source = procedural_patient("head", np.random.default_rng(3), size=64)
    large = source.resized(1.5)
    assert large.body.extent == pytest.approx([1.5 * z for z in source.body.extent])
    phantom, of_large = (each.body.slice(each.height, each.grid) for each in (source, large))
    assert of_large.grid.spacing == pytest.approx(1.5 * phantom.grid.spacing)
    torch.testing.assert_close(of_large.fractions, phantom.fractions)


def test_sizes_are_drawn_for_each_patient_and_end_at_the_field_of_view(tmp_path: Path) -> None:
    recipe = replace(SMALL, cases=6, stations=2, rows=1, scale=(0.8, 1.2))
    scales = {}
    for station in plan(recipe):
        assert scales.setdefault(station.patient, station.scale) == station.scale
    assert len(set(scales.values())) == 6
    assert all(0.8 <= scale <= 1.2 for scale in scales.values())
    shares = [[station.share for station in plan(each)] for each in (recipe, replace(recipe, scale=(1.0, 1.0)))]
    assert shares[0] == shares[1]
    huge = replace(SMALL, cases=1, rows=1, bins=900, tube_voltages_kvp=(120.0,), scale=(10.0, 10.0))
    (scan,) = simulate_dataset(tmp_path / "set", huge)
    grid = read_exposure(tmp_path / "set" / next(iter(scan.files)), tube_voltage_kvp=120.0).grid
    assert grid is not None
    assert grid.spacing * grid.cols == pytest.approx(2 * clinical_fan_beam().field_of_view_radius)


def test_a_body_that_is_too_low_is_refused(tmp_path: Path) -> None:
    tall = Recipe(**{**vars(SMALL), "rows": 1000})
    with pytest.raises(ValueError, match="1000 rows need"):
        list(simulate_dataset(tmp_path / "set", tall))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"anatomies": ("tail",)}, 'no anatomy "tail"'),
        ({"cases": 0}, "needs patients"),
        ({"rows": 0}, "rows must be at least 1"),
        ({"tube_voltages_kvp": (60.0,)}, "70 to 140 kVp"),
        ({"tube_voltages_kvp": (80.0, 80.0)}, "given twice"),
        ({"validation": 0.9, "test": 0.2}, "nor exceed 1 together"),
        ({"validation": float("nan")}, "nor exceed 1 together"),
        ({"simulator": "catsim", "tube_voltages_kvp": (75.0,)}, "steps of 10"),
        ({"noise_hu": 20.0}, "needs such a series"),
        ({"tube_voltages_kvp": (100.0, 100.00001)}, "given twice"),
        ({"seed": -1}, "A seed"),
        ({"scale": (1.2, 0.8)}, "rising factors"),
    ],
)
def test_recipes_that_cannot_be_are_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Recipe(**{**vars(SMALL), **change})


def test_own_bodies_have_names_of_their_own_and_are_given_once(tmp_path: Path) -> None:
    volume = tmp_path / "chest.npz"
    hu = np.full((3, 32, 32), -1000, np.int16)
    hu[:, 8:24, 8:24] = 30
    np.savez(volume, hu=hu, spacing_mm=8.0, z_mm=np.arange(3) * 2.0)
    recipe = Recipe(**{**vars(SMALL), "cases": 1, "bodies": (str(volume),), "noise_hu": 10.0})
    assert [(station.name, station.own) for station in plan(recipe)] == [("head-000", False), ("own-chest-000", True)]
    scans = list(simulate_dataset(tmp_path / "set", recipe))
    assert {scan.source for scan in scans} == {"head", str(volume)}
    twice = Recipe(**{**vars(recipe), "bodies": (str(volume), str(volume))})
    with pytest.raises(ValueError, match="given twice"):
        list(simulate_dataset(tmp_path / "other", twice))
    assert not (tmp_path / "other").exists()


@pytest.mark.slow
def test_workers_end_with_the_process_that_wants_their_work(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(
        "from pathlib import Path\nimport multiprocessing\nfrom pnpct.simulation import Recipe, simulate_dataset\n"
        "if __name__ == '__main__':\n"
        f"    for _ in simulate_dataset(Path({str(tmp_path / 'set')!r}), {SMALL!r}, processes=2):\n"
        "        print(*(child.pid for child in multiprocessing.active_children()), flush=True)\n"
    )
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    with subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE, env=environment) as process:
        assert process.stdout is not None
        workers = [int(word) for word in process.stdout.readline().split()]
        process.kill()
    assert workers
    end = time.monotonic() + 20
    while time.monotonic() < end and any(_alive(worker) for worker in workers):
        time.sleep(0.1)
    assert not any(_alive(worker) for worker in workers)


def _alive(process: int) -> bool:
    """Whether a process runs; one that has ended and waits for its parent to ask does not."""
    status = Path(f"/proc/{process}/stat")
    return status.exists() and status.read_text().rsplit(")", 1)[1].split()[0] != "Z"
