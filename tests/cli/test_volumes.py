"""Volumes and scans of several detector rows at the command line."""

import json

import pytest
import torch

from pnpct.files import Provenance, read_image, write_image, write_scan
from pnpct.geometry import ConeBeam, Detector, ImageGrid, Trajectory, VolumeGrid
from pnpct.physics import Scan

PLANE = ImageGrid(24, 24, spacing=8.0)
STACK = VolumeGrid(PLANE, slices=3, slice_spacing=2.5, z=-30.0)
PROVENANCE = Provenance(["pnpct"], "0.1.0")


@pytest.fixture
def saved(tmp_path, generator):
    """Write water with noise on a grid, always the same one in its slices from the lowest on."""
    noise = 0.02 * torch.randn(3, 24, 24, generator=generator)

    def save(name: str, grid: ImageGrid | VolumeGrid, *, spread: float = 1.0):
        slices = grid.slices if isinstance(grid, VolumeGrid) else 1
        write_image(tmp_path / name, 1 + spread * noise[:slices].reshape(grid.shape), grid, provenance=PROVENANCE)
        return tmp_path / name

    return save


def test_a_volume_stays_where_it_is_from_nifti_to_hdf5(run, saved, tmp_path):
    volume = saved("volume.nii.gz", STACK)
    assert run("denoise", volume, tmp_path / "out.h5", "--denoiser", "tv")[0] == 0
    assert read_image(tmp_path / "out.h5")[1] == STACK
    status, out, _ = run("info", tmp_path / "out.h5")
    assert status == 0
    assert "  slice_spacing_mm: 2.5\n" in out
    assert "  z_mm: -30.0\n" in out


@pytest.mark.parametrize("name", ["image.h5", "image.nii"])
def test_one_slice_of_a_volume_is_compared_with_an_image(run, saved, tmp_path, name):
    one, image = saved("one.nii", VolumeGrid(PLANE, 1, 2.5, z=40.0)), saved(name, PLANE, spread=1.5)
    for first, second in ((one, image), (image, one)):
        status, _, err = run("evaluate", first, second, tmp_path / "numbers.json")
        assert (status, err) == (0, "")
        rmse = json.loads((tmp_path / "numbers.json").read_text())["rmse_hu"]
        assert rmse == pytest.approx(0.5 * 20.0, rel=0.1)


@pytest.mark.parametrize(
    ("grid", "words"),
    [
        (VolumeGrid(PLANE, 3, 2.5, z=-27.5), "z = -32.5 to -27.5 mm against -30 to -25 mm"),
        (VolumeGrid(PLANE, 3, 3.0, z=-30.0), "z = -32.5 to -27.5 mm against -33 to -27 mm"),
        (VolumeGrid(PLANE, 1, 2.5, z=-30.0), "3 x 24 x 24 pixels, the truth 1 x 24 x 24"),
        (PLANE, "3 x 24 x 24 pixels, the truth 24 x 24"),
        (VolumeGrid(ImageGrid(24, 24, 8.0, (4.0, 0.0)), 3, 2.5, z=-30.0), "around (0, 0) mm against"),
    ],
)
def test_volumes_elsewhere_are_not_compared(run, saved, grid, words):
    status, _, err = run("evaluate", saved("volume.nii", STACK), saved("other.h5", grid))
    assert status == 2
    assert words in err
    assert err.endswith("; reconstruct on its grid.\n")


def test_what_is_two_dimensional_asks_for_a_fan_beam(run, tmp_path):
    geometry = ConeBeam(
        Trajectory([0.1 * view for view in range(60)], z=[0.2 * view for view in range(60)]),
        Detector(bins=32, bin_width=16.0, rows=4, row_height=1.1),
        source_to_isocenter=541.0,
        source_to_detector=949.0,
    )
    scan = Scan(torch.full(geometry.shape, 500.0), torch.tensor(1000.0), 0.0, geometry, mu_water=0.0193)
    write_scan(tmp_path / "scan.h5", scan, provenance=PROVENANCE)
    status, out, _ = run("info", tmp_path / "scan.h5")
    assert status == 0
    assert "60 x 4 x 32, float32" in out
    assert "detector_rows: 4" in out
    for method in ("fbp", "tv", "pnp"):
        status, out, err = run("reconstruct", tmp_path / "scan.h5", tmp_path / "image.h5", "--method", method)
        assert (status, out) == (2, "")
        assert err.startswith("pnpct: A fan beam is needed, with one detector row in one plane, but this scan is")
        assert err.count("\n") == 1
    assert not (tmp_path / "image.h5").exists()
