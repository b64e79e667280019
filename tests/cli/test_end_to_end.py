"""Through all commands at small size."""

import json

import h5py
import nibabel as nib
import numpy as np
import pytest
import torch
from PIL import Image as Picture

from pnpct.cli import main
from pnpct.files import Provenance, read_image, read_scan, read_truth, sha256_of
from pnpct.units import to_hu

SMALL = ["--anatomy", "head", "--size", "64", "--views", "60", "--bins", "100"]
TINY = ["--anatomy", "head", "--size", "32", "--views", "40", "--bins", "60"]


def settings_of(path):
    return Provenance.from_json(path.with_name(path.name + ".json").read_text())


def test_from_a_seed_to_numbers(run, tmp_path):
    scan, fbp, pnp, tv = (tmp_path / name for name in ("scan.h5", "fbp.h5", "pnp.nii.gz", "tv.h5"))
    status, out, err = run("simulate", "scan", scan, *SMALL, "--tube-current-ma", "2", "--seed", "3")
    assert (status, err) == (0, "")
    assert out == f"Wrote {scan}: 60 views of 100 bins on an arc, and the truth.\n"
    status, out, err = run("info", scan)
    assert (status, err) == (0, "")
    for line in ("pnpct-scan", "seed: 3", "holds: 60 x 100, float32", "source_to_isocenter_mm: 541.0", "spacing_mm"):
        assert line in out
    assert run("reconstruct", scan, fbp, "--method", "fbp", "--kernel", "soft")[0] == 0
    assert run("reconstruct", scan, pnp, "--denoiser", "tv", "--strength", "40", "--iterations", "4")[0] == 0
    assert run("reconstruct", scan, tv, "--method", "tv")[0] == 0
    errors = {}
    for image in (fbp, pnp, tv):
        numbers = tmp_path / f"{image.name}-metrics.json"
        status, out, err = run("evaluate", image, scan, numbers)
        assert (status, err) == (0, "")
        assert image.name in out
        assert "soft_tissue_rmse_hu" in out
        errors[image] = json.loads(numbers.read_text())["soft_tissue_rmse_hu"]
        assert settings_of(numbers).inputs == {str(path): sha256_of(path) for path in (image, scan)}
    assert errors[pnp] < 0.85 * errors[fbp]
    assert errors[tv] < 0.85 * errors[fbp]
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".")]


def test_the_sidecar_says_what_was_done(run, made, tmp_path):
    image = tmp_path / "image.h5"
    words = ["reconstruct", str(made / "scan.h5"), str(image), "--sigma-v", "40", "--iterations", "2"]
    assert run(*words)[0] == 0
    said = settings_of(image)
    assert said.command == ["pnpct", *words]
    assert said.inputs == {str(made / "scan.h5"): sha256_of(made / "scan.h5")}
    assert said.settings["method"] == "pnp"
    assert said.settings["sigma_v_hu"] == pytest.approx(40, rel=1e-5)
    assert said.settings["iterations_done"] == 2
    assert said.settings["stopped_by"] == "iterations"
    assert said.settings["grid"] == {"rows": 64, "cols": 64, "spacing": 250 / 64, "center": [0, 0]}
    with h5py.File(image) as file:
        assert Provenance.from_json(file.attrs["provenance"]) == said


def test_a_rule_may_stop_it_before(run, made, tmp_path):
    image = tmp_path / "image.h5"
    assert (
        run("reconstruct", made / "scan.h5", image, "--denoiser", "tv", "--stop", "paper", "--iterations", "30")[0] == 0
    )
    said = settings_of(image).settings
    assert said["stopped_by"] == "paper"
    assert 1 <= said["iterations_done"] < 20


def test_one_seed_gives_the_same_scan_and_another_does_not(run, tmp_path):
    bytes_of, images = {}, {}
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        scan, image = tmp_path / f"{name}.h5", tmp_path / f"{name}-image.h5"
        assert run("simulate", "scan", scan, *TINY, "--seed", seed)[0] == 0
        assert run("reconstruct", scan, image, "--iterations", "2")[0] == 0
        with h5py.File(scan) as file, h5py.File(image) as other:
            arrays = [file["counts"][()], file["incident"][()], file["truth/image"][()]]
            images[name] = other["image"][()]
        bytes_of[name] = [array.tobytes() for array in arrays]
    assert bytes_of["a"] == bytes_of["b"]
    counts, incident, truth = (a != c for a, c in zip(bytes_of["a"], bytes_of["c"], strict=True))
    assert (counts, incident, truth) == (True, False, True)
    # The mathematics library under PyTorch rounds by where in memory its arrays lie: 0.1 HU is far above that.
    np.testing.assert_allclose(images["a"], images["b"], atol=1e-4)
    assert np.abs(images["a"] - images["c"]).max() > 0.01


def test_the_same_command_writes_the_same_provenance(run, tmp_path, monkeypatch):
    written = []
    for folder in (tmp_path / "first", tmp_path / "second"):
        folder.mkdir()
        monkeypatch.chdir(folder)
        assert run("simulate", "scan", "scan.h5", *TINY, "--seed", "4")[0] == 0
        written.append((folder / "scan.h5.json").read_bytes())
    assert written[0] == written[1]


def test_a_larger_tube_current_means_more_quanta_of_the_same_patient(run, tmp_path):
    scans = {}
    for current in (20, 200):
        scan = tmp_path / f"{current}.h5"
        assert run("simulate", "scan", scan, *TINY, "--tube-current-ma", current)[0] == 0
        scans[current] = read_scan(scan)
        truth = read_truth(scan)[0]
    torch.testing.assert_close(scans[200].incident, 10 * scans[20].incident)
    assert torch.equal(truth, read_truth(tmp_path / "20.h5")[0])


def test_imported_arrays_are_the_scan_they_came_from(run, made, tmp_path):
    scan = tmp_path / "scan.h5"
    status, out, err = run(
        *("import", "arrays", made / "counts.npy", made / "geometry.json", scan, "--kind", "counts"),
        *(
            "--incident",
            made / "incident.npy",
            "--electronic-noise",
            "2.75",
            "--beam-hardening",
            made / "correction.npy",
        ),
    )
    assert (status, err) == (0, "")
    assert out == f"Wrote {scan}: 60 views of 100 bins on an arc.\n"
    imported, simulated = read_scan(scan), read_scan(made / "scan.h5")
    assert imported.geometry == simulated.geometry
    assert torch.equal(imported.counts, simulated.counts)
    assert len(settings_of(scan).inputs) == 4
    # Without a truth the image covers what the fan sees.
    image = tmp_path / "image.h5"
    assert run("reconstruct", scan, image, "--method", "fbp", "--size", "64")[0] == 0
    _, grid = read_image(image)
    assert grid.shape == (64, 64)
    assert grid.spacing * 64 == pytest.approx(2 * simulated.geometry.field_of_view_radius)


def test_an_array_in_a_larger_file_is_found_by_its_name(run, made, tmp_path):
    file, geometry, scan = tmp_path / "all.npz", made / "geometry.json", tmp_path / "scan.h5"
    np.savez(file, counts=np.load(made / "counts.npy"), incident=np.load(made / "incident.npy"))
    options = ("--kind", "counts", "--incident", f"{file}:incident", "--electronic-noise", 3)
    status, _, err = run("import", "arrays", f"{file}:counts", geometry, scan, *options)
    assert (status, err) == (0, "")
    assert set(settings_of(scan).inputs) == {str(file), str(geometry)}


def test_raw_files_of_catsim_become_the_scan_they_hold(run, made, tmp_path):
    scan = read_scan(made / "scan.h5")
    electrons = 17 * 70.0
    (scan.counts.clamp(min=0) * electrons).numpy().astype("<f4").tofile(tmp_path / "raw.scan")
    (scan.incident * electrons).numpy().astype("<f4").tofile(tmp_path / "raw.air")
    keys = {"sid_mm": 541, "sdd_mm": 949, "n_cols": 100, "col_pitch_mm": 1.0239 * 9, "col_offset_cols": 0.25}
    keys |= {"n_views": 60, "views_per_rotation": 60, "start_angle_deg": 0, "rotation_direction": 1}
    (tmp_path / "raw.json").write_text(json.dumps({**keys, "gain_e_per_keV": 17, "eNoise_e": 3500}))
    status, _, err = run(
        "import", "catsim", tmp_path / "raw", tmp_path / "scan.h5", "--configuration", tmp_path / "raw.json"
    )
    assert (status, err) == (0, "")
    imported = read_scan(tmp_path / "scan.h5")
    torch.testing.assert_close(imported.counts, scan.counts.clamp(min=0))
    torch.testing.assert_close(imported.incident, scan.incident)
    assert {path.split(".")[-1] for path in settings_of(tmp_path / "scan.h5").inputs} == {"scan", "air", "json"}


def test_the_size_and_the_field_of_view_may_be_chosen(run, made, tmp_path):
    for words, shape, side in (
        (["--size", "30"], (30, 30), 250.0),
        (["--field-of-view", "300"], (64, 64), 300.0),
        (["--size", "40", "--field-of-view", "200"], (40, 40), 200.0),
    ):
        assert run("reconstruct", made / "scan.h5", tmp_path / "image.h5", "--method", "fbp", *words)[0] == 0
        _, grid = read_image(tmp_path / "image.h5")
        assert grid.shape == shape
        assert grid.spacing * grid.rows == pytest.approx(side)


def test_images_may_be_written_for_viewers(run, made, tmp_path):
    reference, _ = read_image(made / "image.h5")
    for name in ("image.nii", "image.png"):
        assert run("reconstruct", made / "scan.h5", tmp_path / name, "--method", "fbp")[0] == 0
    voxels = np.asarray(nib.load(tmp_path / "image.nii").dataobj)
    np.testing.assert_allclose(voxels[::-1, ::-1].T, to_hu(reference).numpy(), atol=0.01)
    with Picture.open(tmp_path / "image.png") as picture:
        assert picture.size == (64, 64)


def test_an_image_is_compared_with_an_image_too(run, made, tmp_path):
    status, _, _ = run("evaluate", made / "image.h5", made / "image.h5", tmp_path / "same.json")
    assert status == 0
    numbers = json.loads((tmp_path / "same.json").read_text())
    assert numbers["rmse_hu"] == 0
    assert numbers["psnr_40_400"] is None  # infinite
    assert run("evaluate", made / "image.h5", made / "image.h5")[0] == 0


def test_the_demo_runs_everything_and_what_uses_the_statistics_comes_nearest(run, tmp_path):
    folder = tmp_path / "demo"
    status, out, err = run("demo", folder, "--size", "96", "--views", "100", "--tube-current-ma", "5")
    assert (status, err) == (0, "")
    artefacts = ["scan.h5", "fbp-hann.h5", "fbp-soft.h5", "tv.h5", "pnp.h5", "metrics.json", "comparison.png"]
    assert {path.name for path in folder.iterdir()} == {*artefacts, *(f"{name}.json" for name in artefacts)}
    assert out.count("$ pnpct ") == 5
    assert all(f"Wrote {folder / name}: " in out for name in artefacts)
    numbers = json.loads((folder / "metrics.json").read_text())
    errors = {name: values["soft_tissue_rmse_hu"] for name, values in numbers.items()}
    # Pixels of 5 mm are none that the network has learnt from; it must not be worse than what it replaces.
    assert max(errors["tv"], errors["pnp"]) < min(errors["fbp-hann"], errors["fbp-soft"])
    with Picture.open(folder / "comparison.png") as picture:
        assert picture.width > 4 * 500  # four columns, each with its detail below
        assert picture.height > 2 * 500
        assert json.loads(picture.text["Comment"])["command"][:2] == ["pnpct", "demo"]
    # What it did can be repeated with the commands that it showed.
    shown = [line.removeprefix("$ pnpct ").split() for line in out.splitlines() if line.startswith("$ pnpct ")]
    before, _ = read_image(folder / "fbp-soft.h5")
    assert main(next(words for words in shown if "soft" in words)) == 0
    assert torch.equal(read_image(folder / "fbp-soft.h5")[0], before)
