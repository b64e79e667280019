"""`pnpct reconstruct --geometry cone`."""

import json
from dataclasses import replace

import pytest
import torch
from cone_scans import ANGLES, HELIX, scan_of_water

from pnpct.denoisers import AcrossSlices, make_denoiser
from pnpct.files import Provenance, SlabFolder, read_image, read_scan, write_scan
from pnpct.geometry import ImageGrid, Trajectory, VolumeGrid
from pnpct.operators import ConeProjector
from pnpct.physics import take_log
from pnpct.reconstruction import FBP, PlugAndPlay, reconstruct_cone_volume

IN_CONE = ["--geometry", "cone", "--slices", "3", "--slice-spacing", "1.3", "--size", "24", "--field-of-view", "240"]
PNP = ["--denoiser", "gaussian", "--iterations", "1"]


@pytest.fixture(scope="module")
def helix(tmp_path_factory):
    path = tmp_path_factory.mktemp("scans") / "helix.h5"
    write_scan(path, scan_of_water(HELIX), provenance=Provenance(["pnpct"], "0.1.0"))
    return path


def test_the_command_makes_the_volume_of_the_library_and_goes_on(run, helix, tmp_path, monkeypatch):
    monkeypatch.setattr("pnpct.reconstruction.cone_volume.SLICES_OF_A_SLAB", 2)
    words = ["reconstruct", helix, tmp_path / "out.h5", *IN_CONE, *PNP]
    write = SlabFolder.write

    def interrupted(self, first, image):
        if first:
            raise KeyboardInterrupt
        write(self, first, image)

    with monkeypatch.context() as patch:
        patch.setattr(SlabFolder, "write", interrupted)
        assert run(*words)[0] == 130
    status, out, err = run(*words)
    assert (status, err) == (0, "")
    assert "2 of 3 slices are done already" in out
    volume, grid = read_image(tmp_path / "out.h5")
    scan, method = read_scan(helix), PlugAndPlay(AcrossSlices(make_denoiser("gaussian")), iterations=1)
    slabs = reconstruct_cone_volume(lambda views: take_log(scan[views]), HELIX, grid, method, mu_water=0.02)
    assert torch.equal(volume, torch.cat([slab.image for slab in slabs]))
    assert float((volume[:, 12, 15] - 1).abs().max()) < 0.05
    settings = json.loads((tmp_path / "out.h5.json").read_text())["settings"]
    assert (settings["geometry"], settings["slice_reach"]) == ("cone", 1)


def volume_of_fbp(run, scan, folder) -> tuple[torch.Tensor, str]:
    status, out, err = run("reconstruct", scan, folder / "out.h5", *IN_CONE, "--method", "fbp")
    assert (status, err) == (0, "")
    settings = json.loads((folder / "out.h5.json").read_text())["settings"]
    assert settings["geometry"] == "cone"
    assert settings["notes"][0] in out.replace("\n", " ")
    return read_image(folder / "out.h5")[0], settings["notes"][0]


def test_filtered_back_projection_of_a_circle_is_feldkamps(run, tmp_path):
    circle = replace(HELIX, trajectory=Trajectory(ANGLES[:64]))
    write_scan(tmp_path / "circle.h5", scan_of_water(circle), provenance=Provenance(["pnpct"], "0.1.0"))
    volume, note = volume_of_fbp(run, tmp_path / "circle.h5", tmp_path)
    assert note.startswith("Feldkamp's reconstruction is exact at z = 0 mm")
    grid = VolumeGrid(ImageGrid(24, 24, spacing=10.0), 3, 1.3)
    A = ConeProjector(grid, circle, mu_water=0.02)
    assert torch.equal(volume, FBP()(take_log(read_scan(tmp_path / "circle.h5")), A).image)
    assert float((volume[:, 12, 15] - 1).abs().max()) < 0.02


def test_filtered_back_projection_of_a_helix_is_made_of_planes_and_says_so(run, helix, tmp_path):
    volume, note = volume_of_fbp(run, helix, tmp_path)
    assert note.startswith("Filtered back-projection of a helix is that of planes")
    assert float((volume[:, 12, 15] - 1).abs().max()) < 0.05


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ("--plane-spacing 1", "--plane-spacing is of planes, and --geometry cone has none"),
        ("--rebinning tilted", "--rebinning is of planes, and --geometry cone has none"),
        ("--solver cholesky", "in a cone beam take fourier or cg"),
        ("--slices 500", "covers slices from"),
        ("--processes 0", "at least one process, got 0"),
    ],
)
def test_volumes_that_a_cone_cannot_make(run, helix, tmp_path, words, complaint):
    status, _, err = run("reconstruct", helix, tmp_path / "out.h5", *IN_CONE, *PNP, *words.split())
    assert (status, err.count("\n")) == (2, 1)
    assert complaint in err
    assert not list(tmp_path.iterdir())
