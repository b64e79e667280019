"""What other programs say of a series that was written, where they are installed: Debian's dicom3tools and dcm2niix,
SimpleITK from PyPI."""

import shutil
import subprocess
from pathlib import Path

import nibabel as nib
import numpy as np
import pytest
import torch
from dicom_images import dicom, save

from pnpct.files import (
    Provenance,
    read_dicom_series,
    read_image,
    read_source_series,
    write_dicom_series,
    write_image,
)
from pnpct.geometry import ImageGrid, VolumeGrid

pytestmark = pytest.mark.slow

STACK = VolumeGrid(ImageGrid(20, 24, spacing=0.7, center=(3.0, -5.0)), slices=4, slice_spacing=2.5, z=100.0)
TILTED = [1, 0, 0, 0, 0.965926, 0.258819]
HASH = "ab" * 32


def made_by(method: str) -> Provenance:
    settings = {"method": method, "kernel": "hann"} if method == "fbp" else {"method": method, "denoiser": "n2n"}
    return Provenance(["pnpct"], "0.1.0", inputs={"scan.h5": HASH}, settings=settings)


@pytest.fixture(scope="module")
def written(tmp_path_factory) -> dict[str, Path]:
    """Series of every kind, by name."""
    folder = tmp_path_factory.mktemp("written")
    image = 1 + 0.2 * torch.randn(4, 20, 24, generator=torch.Generator().manual_seed(3))
    write_dicom_series(folder / "fbp", image, STACK, provenance=made_by("fbp"), body_part="CHEST")
    write_dicom_series(folder / "pnp", image, STACK, provenance=made_by("pnp"), body_part="HEAD")
    write_dicom_series(folder / "image", image[0], STACK.plane, provenance=made_by("tv"), body_part="ABDOMEN")
    patient = {"PatientName": "Müller^Änne", "SpecificCharacterSet": "ISO_IR 100", "BodyPartExamined": "CHEST"}
    patient |= {"StudyInstanceUID": "1.2.77", "FrameOfReferenceUID": "1.2.78", "StudyDate": "20200304"}
    patient |= {"StudyTime": "101500", "StudyID": "5", "SliceThickness": 3.0}
    for name, orientation in (("source", [1, 0, 0, 0, 1, 0]), ("tilted", TILTED)):
        slices = [dicom(z, **patient, ImageOrientationPatient=orientation) for z in (0.0, 3.0, 6.0)]
        source = read_source_series(save(folder / f"of-{name}", *slices))
        write_dicom_series(folder / name, source.image, source, provenance=made_by("denoised"))
    return {name: folder / name for name in ("fbp", "pnp", "image", "source", "tilted")}


def program(name: str, *words: object) -> str:
    """Run a program and return all that it wrote."""
    if shutil.which(name) is None:
        pytest.skip(f"{name} is not installed")
    done = subprocess.run([name, *map(str, words)], capture_output=True, text=True)
    return done.stdout + done.stderr


def test_dciodvfy_has_nothing_to_say(written):
    for folder in written.values():
        for path in folder.iterdir():
            assert program("dciodvfy", "-new", path).split() == ["CTImage"]


def test_dcentvfy_has_nothing_to_say(written):
    for folder in written.values():
        assert program("dcentvfy", *folder.iterdir()) == ""


def test_simpleitk_reads_the_same_hu_in_the_same_place(written):
    sitk = pytest.importorskip("SimpleITK", reason="SimpleITK is not installed")
    for name in ("fbp", "pnp"):
        reader = sitk.ImageSeriesReader()
        (uid,) = reader.GetGDCMSeriesIDs(str(written[name]))
        reader.SetFileNames(reader.GetGDCMSeriesFileNames(str(written[name]), uid))
        volume, series = reader.Execute(), read_dicom_series(written[name])
        np.testing.assert_array_equal(sitk.GetArrayFromImage(volume), series.image_hu)
        assert volume.GetSpacing() == pytest.approx((0.7, 0.7, 2.5))
        assert volume.GetDirection() == (1, 0, 0, 0, 1, 0, 0, 0, 1)
        x, y, z = volume.TransformIndexToPhysicalPoint((2, 7, 1))
        assert (x, -y, z) == pytest.approx((STACK.plane.x[2], STACK.plane.y[7], STACK.heights[1]))


def test_dcm2niix_puts_it_where_our_own_nifti_has_it(written, tmp_path):
    said = program("dcm2niix", "-o", tmp_path, "-f", "theirs", written["pnp"])
    assert "Convert 4 DICOM" in said
    image, grid = read_image(tmp_path / "theirs.nii")
    series = read_dicom_series(written["pnp"])
    assert torch.equal((1000 * (image - 1)).round(), torch.from_numpy(series.image_hu.astype(np.float32)))
    assert grid.heights == pytest.approx(STACK.heights)
    assert grid.plane.center == pytest.approx(STACK.plane.center, abs=1e-4)
    write_image(tmp_path / "ours.nii", series.image, series.grid, provenance=made_by("pnp"))
    ours, theirs = nib.load(tmp_path / "ours.nii"), nib.load(tmp_path / "theirs.nii")
    theirs = nib.as_closest_canonical(theirs)
    np.testing.assert_allclose(ours.affine, theirs.affine, atol=1e-4)
    np.testing.assert_allclose(ours.get_fdata(), theirs.get_fdata(), atol=1e-3)
