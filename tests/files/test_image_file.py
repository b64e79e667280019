import json
import re
from dataclasses import replace

import nibabel as nib
import numpy as np
import pytest
import torch
from PIL import Image as Picture

from pnpct.files import FileFormatError, Provenance, describe_file, read_image, write_image
from pnpct.geometry import ImageGrid, VolumeGrid

PROVENANCE = Provenance(["pnpct", "reconstruct"], "0.1.0")
GRID = ImageGrid(4, 6, spacing=0.7, center=(12.5, -3.25))
STACK = VolumeGrid(GRID, slices=3, slice_spacing=2.5, z=-140.25)


@pytest.fixture
def image(generator):
    """Nothing about it is symmetric."""
    return 2.0 * torch.rand(4, 6, generator=generator)


@pytest.fixture
def marked():
    """Air, with bone in the upper left corner (smallest x, largest y) and water beside it to the right."""
    image = torch.zeros(4, 6)
    image[0, 0], image[0, 1] = 2.0, 1.0
    return image


@pytest.mark.parametrize("batch", [(), (3,), (2, 3)])
def test_hdf5_gives_the_same_image(tmp_path, generator, batch):
    image = torch.rand(*batch, 4, 6, generator=generator)
    write_image(tmp_path / "image.h5", image, GRID, provenance=PROVENANCE)
    read, grid = read_image(tmp_path / "image.h5")
    assert torch.equal(read, image)
    assert grid == GRID


@pytest.mark.parametrize("batch", [(), (2,)])
def test_hdf5_gives_the_same_volume(tmp_path, generator, batch):
    volume = torch.rand(*batch, *STACK.shape, generator=generator)
    write_image(tmp_path / "volume.h5", volume, STACK, provenance=PROVENANCE)
    read, grid = read_image(tmp_path / "volume.h5")
    assert torch.equal(read, volume)
    assert grid == STACK
    attributes = describe_file(tmp_path / "volume.h5")["attributes"]["image"]
    assert {key: attributes[key] for key in ("slices", "slice_spacing_mm", "z_mm")} == {
        "slices": 3,
        "slice_spacing_mm": 2.5,
        "z_mm": -140.25,
    }


@pytest.mark.parametrize("suffix", [".nii", ".nii.gz"])
@pytest.mark.parametrize("grid", [GRID, STACK, replace(STACK, slices=1, z=0.3)], ids=["image", "volume", "one slice"])
def test_nifti_gives_the_same_image_to_float32_rounding(tmp_path, generator, suffix, grid):
    image = 2.0 * torch.rand(grid.shape, generator=generator)
    write_image(tmp_path / f"image{suffix}", image, grid, provenance=PROVENANCE)
    read, read_grid = read_image(tmp_path / f"image{suffix}")
    # HU up to 1000 in float32 are good to 3e-5 HU, which is 3e-8 of water; then the result is rounded.
    torch.testing.assert_close(read, image, rtol=2e-7, atol=6e-8)
    assert read_grid == grid


def test_an_image_without_a_height_is_two_dimensional_nifti(tmp_path, image):
    write_image(tmp_path / "image.nii", image, GRID, provenance=PROVENANCE)
    header = nib.load(tmp_path / "image.nii").header
    assert header["dim"][:3].tolist() == [2, 6, 4]


def test_nifti_shows_hu_where_they_are_in_the_patient(tmp_path, marked):
    grid = replace(STACK, slices=1)
    write_image(tmp_path / "image.nii", marked[None], grid, provenance=PROVENANCE)
    nifti = nib.load(tmp_path / "image.nii")
    assert nib.aff2axcodes(nifti.affine) == ("R", "A", "S")
    assert nifti.header.get_zooms() == pytest.approx((0.7, 0.7, 2.5))
    assert nifti.header.get_xyzt_units()[0] == "mm"
    assert nifti.get_data_dtype() == np.float32
    hu = np.asarray(nifti.dataobj)

    def patient(value):
        """Right, front, head of the only voxel with this HU."""
        (voxel,) = np.argwhere(hu == value)
        return nifti.affine @ [*voxel, 1.0]

    # Smallest x is farthest to the patient's right, largest y to the front.
    assert patient(1000.0)[:3] == pytest.approx((-GRID.x[0], GRID.y[0], -140.25), abs=1e-5)
    assert patient(0.0)[:3] == pytest.approx((-GRID.x[1], GRID.y[0], -140.25), abs=1e-5)
    assert (hu == -1000.0).sum() == 22


def test_slices_are_the_third_axis_at_their_heights(tmp_path, generator):
    image = torch.rand(3, 4, 6, generator=generator)
    write_image(tmp_path / "image.nii", image, STACK, provenance=PROVENANCE)
    nifti = nib.load(tmp_path / "image.nii")
    assert nifti.shape == (6, 4, 3)
    # By hand: the middle slice of three is at z = -140.25 mm, the lowest 2.5 mm below; the last column is at
    # x = 12.5 + 2.5 * 0.7 = 14.25 mm, the last row at y = -3.25 - 1.5 * 0.7 = -4.3 mm, and right is -x.
    for affine in (nifti.get_sform(), nifti.get_qform()):
        expected = [[0.7, 0, 0, -14.25], [0, 0.7, 0, -4.3], [0, 0, 2.5, -142.75], [0, 0, 0, 1]]
        np.testing.assert_allclose(affine, expected, atol=1e-5)
    assert np.asarray(nifti.dataobj)[5, 3, 1] == pytest.approx(1000.0 * (float(image[1, 0, 0]) - 1.0))


@pytest.mark.parametrize("towards", [1.0, -1.0])
def test_a_nifti_file_in_another_order_is_the_same_volume(tmp_path, generator, towards):
    write_image(tmp_path / "volume.nii", torch.rand(STACK.shape, generator=generator), STACK, provenance=PROVENANCE)
    nifti = nib.load(tmp_path / "volume.nii")
    turned = nifti.as_reoriented(nib.io_orientation(np.diag([-1.0, -1.0, towards, 1.0])))  # as DICOM orders it
    assert nib.aff2axcodes(turned.affine) == ("L", "P", "S" if towards > 0 else "I")
    nib.save(turned, tmp_path / "turned.nii")
    read, grid = read_image(tmp_path / "turned.nii")
    assert torch.equal(read, read_image(tmp_path / "volume.nii")[0])
    assert grid == STACK


@pytest.mark.parametrize("third", [0.0, 3.0])
def test_two_dimensions_from_elsewhere_are_an_image(tmp_path, third):
    hu = np.full((3, 2), -1000.0, np.float32)
    hu[0, 1] = 40.0  # the patient's left, since the first axis runs to the right from there, and the front
    elsewhere = nib.Nifti1Image(hu, np.diag([2.0, 2.0, 1.0, 1.0]))
    elsewhere.header.set_sform(np.diag([2.0, 2.0, third, 1.0]), code="scanner")
    nib.save(elsewhere, tmp_path / "two.nii.gz")
    image, grid = read_image(tmp_path / "two.nii.gz")
    assert grid == ImageGrid(2, 3, spacing=2.0, center=(-2.0, 1.0))
    torch.testing.assert_close(image, torch.tensor([[0.0, 0.0, 1.04], [0.0, 0.0, 0.0]]))


def test_one_time_of_four_dimensions_is_a_volume(tmp_path):
    affine = np.array([[2.0, 0, 0, 0], [0, 2.0, 0, 0], [0, 0, 3.0, 21.0], [0, 0, 0, 1]])
    nib.save(nib.Nifti1Image(np.full((4, 4, 2, 1), 40, np.float32), affine), tmp_path / "four.nii")
    image, grid = read_image(tmp_path / "four.nii")
    assert image.shape == (2, 4, 4)
    assert (grid.slice_spacing, grid.heights.tolist()) == (3.0, [21.0, 24.0])


def test_a_plane_that_is_not_axial_is_refused(tmp_path):
    sagittal = np.array([[0, 0, 1.0, 0], [1.0, 0, 0, 0], [0, 1.0, 0, 0], [0, 0, 0, 1]])
    nib.save(nib.Nifti1Image(np.zeros((4, 5), np.float32), sagittal), tmp_path / "two.nii")
    with pytest.raises(FileFormatError, match="square pixels along the patient's axes were needed"):
        read_image(tmp_path / "two.nii")


@pytest.mark.parametrize("spacing", [0.7, 0.87890625, 450 / 513, 1.0])
def test_the_spacing_of_nifti_is_the_one_that_was_meant(tmp_path, image, spacing):
    grid = ImageGrid(4, 6, spacing=spacing, center=(0.1, -200.3))
    write_image(tmp_path / "image.nii", image, grid, provenance=PROVENANCE)
    read = read_image(tmp_path / "image.nii")[1]
    assert read.spacing == pytest.approx(spacing, rel=1e-6)
    assert read.center == pytest.approx((0.1, -200.3), abs=1e-4)


def test_png_shows_the_window_with_row_zero_on_top(tmp_path, marked):
    write_image(tmp_path / "image.png", marked, GRID, provenance=PROVENANCE, window=(0.0, 400.0))
    with Picture.open(tmp_path / "image.png") as picture:
        assert (picture.mode, picture.size) == ("L", (6, 4))
        greys = np.asarray(picture)
    assert greys[0].tolist() == [255, 128, 0, 0, 0, 0]
    assert greys[1:].max() == 0


def test_png_has_the_window_of_soft_tissue_by_default(tmp_path):
    hu = torch.tensor([[-120.0, 29.0, 180.0, 31.0]])
    write_image(tmp_path / "image.png", 1.0 + hu / 1000.0, ImageGrid(1, 4, 1.0), provenance=PROVENANCE)
    with Picture.open(tmp_path / "image.png") as picture:
        assert np.asarray(picture).tolist() == [[0, 127, 255, 128]]


def test_slices_stand_side_by_side_in_png(tmp_path, marked):
    write_image(tmp_path / "image.png", torch.stack([marked, marked.flip(-1)]), GRID, provenance=PROVENANCE)
    with Picture.open(tmp_path / "image.png") as picture:
        greys = np.asarray(picture)
    assert greys.shape == (4, 12)
    assert greys[0, 0] == greys[0, 11] == 255


def test_png_cannot_be_read_back(tmp_path, image):
    write_image(tmp_path / "image.png", image, GRID, provenance=PROVENANCE)
    with pytest.raises(ValueError, match=r"a PNG shows 256 greys of a window, not HU; read the \.h5 or \.nii"):
        read_image(tmp_path / "image.png")


def test_the_provenance_is_in_every_format(tmp_path, image):
    for suffix in (".h5", ".nii.gz", ".png"):
        write_image(tmp_path / f"image{suffix}", image, GRID, provenance=PROVENANCE)
    (comment,) = nib.load(tmp_path / "image.nii.gz").header.extensions
    assert Provenance.from_json(comment.text) == PROVENANCE
    with Picture.open(tmp_path / "image.png") as picture:
        assert Provenance.from_json(picture.text["Comment"]) == PROVENANCE
    known = describe_file(tmp_path / "image.h5")
    assert known["provenance"] == vars(PROVENANCE)
    assert known["arrays"]["image"]["shape"] == (4, 6)
    assert json.loads(json.dumps(known))["attributes"]["image"]["spacing_mm"] == 0.7


@pytest.mark.parametrize("suffix", [".h5", ".nii", ".nii.gz", ".png"])
def test_one_image_gives_the_same_bytes_twice_and_leaves_one_file(tmp_path, image, suffix):
    path = tmp_path / f"image{suffix}"
    written = []
    for _ in range(2):
        write_image(path, image, GRID, provenance=PROVENANCE)
        written.append(path.read_bytes())
    assert written[0] == written[1]
    assert list(tmp_path.iterdir()) == [path]


def test_gradients_and_other_precisions_do_not_matter(tmp_path, image):
    write_image(tmp_path / "image.h5", image.double().requires_grad_(), GRID, provenance=PROVENANCE)
    assert torch.equal(read_image(tmp_path / "image.h5")[0], image)


@pytest.mark.parametrize(
    ("name", "shape", "options", "message"),
    [
        ("image.jpg", (4, 6), {}, "Images are stored as .h5, .nii, .nii.gz or .png; got image.jpg"),
        ("image.dcm", (4, 6), {}, "a DICOM series is given by its folder; got image.dcm"),
        ("image", (4, 6), {}, "got image."),
        ("image.h5", (6, 4), {}, "must end in the grid's (4, 6), got (6, 4)"),
        ("image.nii", (2, 4, 6), {}, "one image or one volume, got a batch of the shape (2, 4, 6); use .h5"),
        ("image.png", (2, 2, 4, 6), {}, "an image or one row of slices, got the shape (2, 2, 4, 6); use .h5"),
        ("image.png", (4, 6), {"window": (30.0, 0.0)}, "positive width in HU, got (30.0, 0.0)"),
        ("image.png", (4, 6), {"window": (float("nan"), 1.0)}, "positive width in HU, got (nan, 1.0)"),
    ],
)
def test_what_cannot_be_written_is_one_sentence(tmp_path, name, shape, options, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        write_image(tmp_path / name, torch.ones(shape), GRID, provenance=PROVENANCE, **options)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("suffix", [".h5", ".nii", ".png"])
def test_values_that_are_not_finite_are_refused(tmp_path, image, suffix):
    image[1, 2] = torch.nan
    with pytest.raises(ValueError, match="was not written: the image holds values that are not finite"):
        write_image(tmp_path / f"image{suffix}", image, GRID, provenance=PROVENANCE)


@pytest.mark.parametrize("suffix", [".h5", ".nii", ".nii.gz"])
@pytest.mark.parametrize("kept", [0.0, 0.1, 0.5, 0.99])
def test_a_truncated_file_is_one_sentence(tmp_path, generator, suffix, kept):
    path = tmp_path / f"image{suffix}"
    image = torch.rand(40, 60, generator=generator)
    write_image(path, image, ImageGrid(40, 60, 1.0), provenance=PROVENANCE)
    content = path.read_bytes()
    path.write_bytes(content[: int(kept * len(content))])
    with pytest.raises(FileFormatError, match=f"^{path}: this (is not|file is truncated)") as raised:
        read_image(path)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    "affine",
    [
        np.diag([1.0, 2.0, 1.0, 1.0]),
        np.array([[0.8, -0.6, 0, 0], [0.6, 0.8, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]),
        np.diag([1.0, 0.0, 1.0, 1.0]),
        np.diag([1e-30, 1.0, 1.0, 1.0]),
    ],
)
@pytest.mark.parametrize("shape", [(4, 4), (4, 4, 1), (4, 4, 3)])
def test_other_pixels_of_nifti_are_refused(tmp_path, affine, shape):
    image = nib.Nifti1Image(np.zeros(shape, np.float32), np.eye(4))
    image.set_qform(None, code=0)
    image.set_sform(affine, code=1)
    nib.save(image, tmp_path / "image.nii")
    with pytest.raises(FileFormatError, match="square pixels along the patient's axes were needed"):
        read_image(tmp_path / "image.nii")


def test_four_axes_of_nifti_are_refused(tmp_path):
    nib.save(nib.Nifti1Image(np.zeros((4, 4, 1, 2), np.float32), np.eye(4)), tmp_path / "image.nii")
    with pytest.raises(FileFormatError, match=r"two or three axes were needed, got the shape \(4, 4, 1, 2\)"):
        read_image(tmp_path / "image.nii")


def test_nibabel_says_nothing_of_its_own(tmp_path, image, caplog):
    write_image(tmp_path / "image.nii", image, GRID, provenance=PROVENANCE)
    content = bytearray((tmp_path / "image.nii").read_bytes())
    content[252:254] = (40).to_bytes(2, "little")  # the qform's code, of which there are four
    (tmp_path / "image.nii").write_bytes(content)
    assert read_image(tmp_path / "image.nii")[1] == GRID
    assert not caplog.records


def test_a_missing_file_is_named(tmp_path):
    for suffix in (".h5", ".nii"):
        with pytest.raises(FileNotFoundError, match=f"There is no file .*absent{suffix}"):
            read_image(tmp_path / f"absent{suffix}")
