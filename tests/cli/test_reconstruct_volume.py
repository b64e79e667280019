"""`pnpct reconstruct` for scans with several detector rows."""

import json
from dataclasses import replace

import numpy as np
import pytest
import torch
from cone_scans import HELIX, scan_of_water

from pnpct.files import Provenance, SlabFolder, read_image, read_scan, write_scan
from pnpct.geometry import ImageGrid, Trajectory, VolumeGrid
from pnpct.physics import take_log
from pnpct.reconstruction import FBP, reconstruct_volume

CIRCLE = replace(HELIX, trajectory=Trajectory(HELIX.trajectory.angles[:64], z=[10.0] * 64))
PLANE = ImageGrid(24, 24, spacing=10.0)
FBP_OF_20 = ["--method", "fbp", "--slices", "20", "--slice-spacing", "0.5", "--size", "24", "--field-of-view", "240"]


@pytest.fixture(scope="module")
def scans(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scans")
    for name, geometry in (("helix", HELIX), ("circle", CIRCLE)):
        write_scan(folder / f"{name}.h5", scan_of_water(geometry), provenance=Provenance(["pnpct"], "0.1.0"))
    return folder


def test_the_command_makes_the_volume_of_the_library(run, scans, tmp_path):
    status, out, err = run("reconstruct", scans / "helix.h5", tmp_path / "out.h5", *FBP_OF_20)
    assert (status, err) == (0, "")
    assert "20 slices 0.5 mm apart of 24 x 24 pixels of 10 mm" in out
    volume, grid = read_image(tmp_path / "out.h5")
    scan = read_scan(scans / "helix.h5")
    slabs = reconstruct_volume(lambda views: take_log(scan[views]), HELIX, grid, FBP(), mu_water=0.02)
    assert torch.equal(volume, torch.cat([slab.image for slab in slabs]))
    inside = np.hypot(PLANE.x[None] - 30.0, PLANE.y[:, None]) < 60.0
    assert np.abs(volume.numpy()[:, inside] - 1).max() < 0.04
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.h5", "out.h5.json"]


def test_an_interrupted_volume_goes_on_and_ends_with_the_same_bytes(run, scans, tmp_path, monkeypatch):
    words = ["reconstruct", scans / "helix.h5", "out.h5", *FBP_OF_20]
    for folder in ("whole", "twice"):
        (tmp_path / folder).mkdir()
    monkeypatch.chdir(tmp_path / "whole")
    assert run(*words)[0] == 0
    monkeypatch.chdir(tmp_path / "twice")
    write = SlabFolder.write

    def interrupted(self, first, image):
        if first:
            raise KeyboardInterrupt
        write(self, first, image)

    with monkeypatch.context() as patch:
        patch.setattr(SlabFolder, "write", interrupted)
        assert run(*words)[0] == 130
    assert [path.name for path in (tmp_path / "twice").iterdir()] == ["out.h5.slabs"]
    status, _, err = run(*words, "--thickness", "2")
    assert status == 2
    assert err.startswith("pnpct: out.h5.slabs holds slabs of another volume")
    status, out, _ = run(*words)
    assert status == 0
    assert "8 of 20 slices are done already" in out
    for name in ("out.h5", "out.h5.json"):
        assert (tmp_path / "twice" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()
    assert not (tmp_path / "twice" / "out.h5.slabs").exists()


def test_what_is_not_given_is_what_the_scan_covers(run, scans, tmp_path):
    assert run("reconstruct", scans / "helix.h5", tmp_path / "out.nii", "--method", "fbp", "--size", "16")[0] == 0
    _, grid = read_image(tmp_path / "out.nii")
    assert grid.slice_spacing == pytest.approx(HELIX.row_height_at_isocenter, rel=1e-5)
    assert grid.plane.spacing == pytest.approx(2 * HELIX.field_of_view_radius / 16, rel=1e-5)
    assert 10.0 < (grid.slices - 1) * grid.slice_spacing < 50.0 - 0.6 * 20.0
    settings = json.loads((tmp_path / "out.nii.json").read_text())["settings"]
    assert settings["grid"]["slices"] == grid.slices


def test_the_slices_of_a_truth_are_those_of_the_volume(run, tmp_path):
    grid = VolumeGrid(PLANE, 60, 1.0, z=25.3)
    provenance = Provenance(["pnpct"], "0.1.0")
    truth = (torch.ones(grid.shape), grid)
    write_scan(tmp_path / "scan.h5", scan_of_water(HELIX), provenance=provenance, truth=truth)
    assert run("reconstruct", tmp_path / "scan.h5", tmp_path / "out.h5", "--method", "fbp")[0] == 0
    _, made = read_image(tmp_path / "out.h5")
    assert made.plane == PLANE
    assert 10 < made.slices < 60
    assert set(np.round(made.heights, 6)) < set(np.round(grid.heights, 6))


def test_an_axial_scan_is_said_to_be_exact_in_its_middle_only(run, scans, tmp_path):
    words = ["--method", "fbp", "--size", "24", "--field-of-view", "240", "--slices", "3", "--center", "5", "0", "9"]
    status, out, _ = run("reconstruct", scans / "circle.h5", tmp_path / "out.h5", *words)
    assert status == 0
    assert "edges along z are blurred by as much" in out
    _, grid = read_image(tmp_path / "out.h5")
    assert (grid.plane.center, grid.slices, grid.z) == ((5.0, 0.0), 3, 9.0)


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ("--slices 500", "covers slices from"),
        ("--slices 0", "at least one slice, got 0"),
        ("--slice-spacing -1", "distance between slices must be a positive length in mm, got -1"),
        ("--thickness -2", "thickness of slices is a length in mm from 0 up, got -2"),
        ("--thickness 200", "No slice of 200 mm is covered"),
        ("--thickness nan", "thickness of slices is a length in mm from 0 up, got nan"),
        ("--plane-spacing 0", "distance between planes must be a positive length in mm, got 0"),
        ("--plane-spacing 0 --method pnp --denoiser tv", "distance between planes must be a positive length in mm"),
        ("--plane-spacing 1e-9", "distance between planes must be at least 0.014 mm, a hundredth of a detector row"),
        ("--processes 0", "at least one process, got 0"),
        ("--processes 2 --cluster tcp://127.0.0.1:8786", "--cluster has its own workers; leave out one"),
        ("--center 1", "x and y in mm, and z for a volume, got 1 numbers"),
        ("--center 0 0 500", "covers slices from"),
        ("--field-of-view 2000", "circle of the focal spot"),
    ],
)
def test_volumes_that_cannot_be(run, scans, tmp_path, words, complaint):
    command = ["reconstruct", scans / "helix.h5", tmp_path / "out.h5", "--method", "fbp", "--size", "16"]
    status, _, err = run(*command, *words.split())
    assert status == 2
    assert complaint in err
    assert err.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_slices_have_no_effect_on_a_scan_of_one_plane(run, made, tmp_path):
    for words in (["--slices", "3"], ["--thickness", "1"], ["--rebinning", "tilted"], ["--processes", "2"]):
        status, _, err = run("reconstruct", made / "scan.h5", tmp_path / "out.h5", "--method", "fbp", *words)
        assert status == 2
        assert f"{words[0]} is for scans with several detector rows" in err
    status, _, err = run("reconstruct", made / "scan.h5", tmp_path / "out.h5", "--method", "fbp", "--center", *"123")
    assert (status, "x and y in mm for a scan of one plane, got 3 numbers" in err) == (2, True)
    assert run("reconstruct", made / "scan.h5", tmp_path / "out.h5", "--method", "fbp", "--center", "5", "-4")[0] == 0
    assert read_image(tmp_path / "out.h5")[1].center == (5.0, -4.0)


def test_priors_see_neighbouring_planes(run, scans, tmp_path):
    words = ("--size", "24", "--slices", "3", "--denoiser", "gaussian", "--iterations", "1")
    images = {}
    for hu in ("0", "1000"):
        out = tmp_path / f"{hu}.h5"
        assert run("reconstruct", scans / "circle.h5", out, *words, "--slice-agreement-hu", hu)[0] == 0
        images[hu] = read_image(out)[0]
        settings = json.loads((tmp_path / f"{hu}.h5.json").read_text())["settings"]
        assert (settings["slice_agreement_hu"], settings["slice_reach"]) == (float(hu), 1)
    assert not torch.equal(images["0"], images["1000"])
    assert run("reconstruct", scans / "helix.h5", tmp_path / "helix.h5", *words)[0] == 0
    settings = json.loads((tmp_path / "helix.h5.json").read_text())["settings"]
    assert (settings["slice_agreement_hu"], settings["slice_reach"]) == (30.0, 2)  # planes are half a row apart
    for refused, kind in (("--method tv --slice-agreement-hu 9", "pnp"), ("--across 1", "tv")):
        status, _, err = run("reconstruct", scans / "helix.h5", tmp_path / "no.h5", *refused.split())
        assert (status, f"has an effect on --method {kind} alone" in err) == (2, True)
    for across in ("0", "1"):
        out, words = tmp_path / f"tv{across}.h5", ("--size", "24", "--slices", "3", "--iterations", "1")
        assert run("reconstruct", scans / "circle.h5", out, *words, "--method", "tv", "--across", across)[0] == 0
    assert not torch.equal(read_image(tmp_path / "tv0.h5")[0], read_image(tmp_path / "tv1.h5")[0])
