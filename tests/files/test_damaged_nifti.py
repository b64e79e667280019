"""NIfTI files with headers that no program writes."""

import gzip

import numpy as np
import pytest
import torch

from pnpct.files import FileFormatError, Provenance, read_image, write_image
from pnpct.geometry import ImageGrid

GRID, PROVENANCE = ImageGrid(4, 6, 1.0), Provenance([], "0")


@pytest.fixture
def image() -> torch.Tensor:
    return torch.rand(GRID.shape)


def test_a_unit_that_nifti_does_not_know_is_refused(tmp_path, image):
    write_image(tmp_path / "image.nii", image, GRID, provenance=PROVENANCE)
    content = bytearray((tmp_path / "image.nii").read_bytes())
    content[123] = 4
    (tmp_path / "image.nii").write_bytes(content)
    with pytest.raises(FileFormatError, match="its distances have a unit of no known code"):
        read_image(tmp_path / "image.nii")


@pytest.mark.parametrize("suffix", [".nii", ".nii.gz"])
def test_more_voxels_than_any_file_has_are_refused(tmp_path, image, suffix):
    path = tmp_path / f"image{suffix}"
    write_image(path, image, GRID, provenance=PROVENANCE)
    content = bytearray((gzip.decompress if suffix == ".nii.gz" else bytes)(path.read_bytes()))
    content[40:48] = np.array([3, 30_000, 30_000, 30_000], "<i2").tobytes()
    path.write_bytes(gzip.compress(content) if suffix == ".nii.gz" else content)
    with pytest.raises(FileFormatError, match="declares more voxels than the memory holds"):
        read_image(path)
