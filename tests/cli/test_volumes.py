"""Volumes at the command line."""

import json

import pytest
import torch

from pnpct.files import Provenance, read_image, write_image
from pnpct.geometry import ImageGrid, VolumeGrid

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
