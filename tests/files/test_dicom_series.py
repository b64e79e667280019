import errno

import numpy as np
import pytest
from dicom_images import COLS, ROWS, STANDARD, dicom, save, stored_pixels
from pydicom import Dataset
from pydicom.dataset import FileMetaDataset
from pydicom.encaps import encapsulate
from pydicom.uid import (
    EnhancedCTImageStorage,
    ExplicitVRLittleEndian,
    ImplicitVRLittleEndian,
    JPEGLosslessSV1,
    MediaStorageDirectoryStorage,
    MRImageStorage,
    RLELossless,
    SecondaryCaptureImageStorage,
)

from pnpct.files import FileFormatError, dicom_open, read_dicom_series
from pnpct.geometry import ImageGrid, VolumeGrid


def test_slices_are_ordered_by_their_height(tmp_path):
    series = read_dicom_series(save(tmp_path, *(dicom(z) for z in (4.5, -1.5, 7.5, 1.5))))
    assert series.z == (-1.5, 1.5, 4.5, 7.5)
    # By hand: the first of 6 x 4 pixels is at (-1, -2), so the middle is at -1 + 2.5 * 0.7 = 0.75 mm to the left and
    # at -2 + 1.5 * 0.7 = -0.95 mm to the back; the middle of the slices is half-way between -1.5 and 7.5 mm.
    assert series.grid.plane.center == pytest.approx((0.75, 0.95))
    assert series.grid == VolumeGrid(ImageGrid(ROWS, COLS, 0.7, series.plane.center), 4, slice_spacing=3.0, z=3.0)
    assert series.grid.heights.tolist() == list(series.z)
    assert series.image_hu.dtype == np.int16
    np.testing.assert_array_equal(series.image_hu, np.stack([stored_pixels(z) for z in series.z]))


def test_a_single_slice_is_a_series(tmp_path):
    series = read_dicom_series(save(tmp_path, dicom(2.0)))
    assert series.z == (2.0,)
    with pytest.raises(ValueError, match="thickness of the only slice, at z = 2 mm, is not known"):
        series.grid  # noqa: B018 - it is reckoned when it is asked for


def test_a_single_slice_is_as_thick_as_it_says(tmp_path):
    series = read_dicom_series(save(tmp_path, dicom(2.0, SliceThickness=1.25)))
    assert (series.grid.slices, series.grid.slice_spacing, series.grid.z) == (1, 1.25, 2.0)
    (tmp_path / "0.dcm").unlink()
    series = read_dicom_series(save(tmp_path, dicom(2.0, SliceThickness=""), dicom(3.0, SliceThickness="")))
    assert series.slice_thickness is None


@pytest.mark.parametrize(
    "orientation",
    [STANDARD, [-1, 0, 0, 0, 1, 0], [1, 0, 0, 0, -1, 0], [-1, 0, 0, 0, -1, 0]]
    + [[0, a, 0, b, 0, 0] for a in (1, -1) for b in (1, -1)],
)
def test_the_front_is_on_top_and_the_left_side_at_plus_x(tmp_path, orientation):
    # Each pixel holds where it is: tens grow to the back, ones to the patient's left.
    along_row, along_column = np.array(orientation[:3]), np.array(orientation[3:])
    position = np.arange(COLS)[None, :, None] * along_row + np.arange(ROWS)[:, None, None] * along_column
    x, y, _ = np.moveaxis(position - position.min(axis=(0, 1)), -1, 0)
    folder = save(tmp_path, dicom(0.0, (10 * y + x).astype(np.int16), ImageOrientationPatient=orientation))
    series = read_dicom_series(folder)
    rows, cols = series.plane.shape
    np.testing.assert_array_equal(series.image_hu[0], 10 * np.arange(rows)[:, None] + np.arange(cols))
    # The first stored pixel is at (-1, -2) mm of the patient, to the left and to the back, wherever it is shown now.
    at = int(np.flatnonzero(series.image_hu[0] == 10 * y[0, 0] + x[0, 0])[0])
    assert (series.plane.x[at % cols], -series.plane.y[at // cols]) == pytest.approx((-1.0, -2.0))


@pytest.mark.parametrize("dtype", [np.int16, np.uint16])
@pytest.mark.parametrize("syntax", [ExplicitVRLittleEndian, ImplicitVRLittleEndian, RLELossless])
def test_slope_and_intercept_make_hu(tmp_path, dtype, syntax):
    pixels = np.array([[0, 24], [1024, 4095]], dtype=dtype)
    image = dicom(0.0, pixels, RescaleSlope=2, RescaleIntercept=-1024, syntax=ExplicitVRLittleEndian)
    if syntax == RLELossless:
        image.compress(RLELossless)
    else:
        image.file_meta.TransferSyntaxUID = syntax
    series = read_dicom_series(save(tmp_path, image))
    np.testing.assert_array_equal(series.image_hu[0], [[-1024, -976], [1024, 7166]])


def test_fractions_of_hu_are_kept(tmp_path):
    folder = save(tmp_path, dicom(0.0), dicom(1.0, RescaleSlope=0.5, RescaleIntercept=-0.25))
    series = read_dicom_series(folder)
    assert series.image_hu.dtype == np.float32
    np.testing.assert_array_equal(series.image_hu[0], stored_pixels(0.0))
    np.testing.assert_array_equal(series.image_hu[1], stored_pixels(1.0) * 0.5 - 0.25)


def test_hu_beyond_16_bits_are_cut_off(tmp_path):
    pixels = np.array([[20000, 1000]], dtype=np.int16)
    series = read_dicom_series(save(tmp_path, dicom(0.0, pixels, RescaleSlope=2, RescaleIntercept=-1024)))
    assert series.image_hu.tolist() == [[[32767, 976]]]


def test_padding_that_lost_its_sign_and_its_tag_is_air(tmp_path):
    pixels = np.array([[63536, 1064, 32767]], dtype=np.uint16)  # -2000 in two's complement
    series = read_dicom_series(save(tmp_path, dicom(0.0, pixels, RescaleIntercept=-1024)))
    assert series.image_hu.tolist() == [[[-1000, 40, 31743]]]


@pytest.mark.parametrize("syntax", [ExplicitVRLittleEndian, ImplicitVRLittleEndian])
@pytest.mark.parametrize(
    ("pixels", "changes", "expected"),
    [
        (np.array([[0, 63, 64, 1000]], np.int16), {"PixelPaddingValue": 63}, [0, -1000, 64, 1000]),
        (
            np.array([[0, 63, 64, 70, 71]], np.int16),
            {"PixelPaddingValue": 63, "PixelPaddingRangeLimit": 70},
            [0, -1000, -1000, -1000, 71],
        ),
        (np.array([[5, 63]], np.int16), {"PixelPaddingValue": 70, "PixelPaddingRangeLimit": 60}, [5, -1000]),
        (np.array([[-2000, -1025, -1024, -900]], np.int16), {}, [-1000, -1000, -1024, -900]),
        (np.array([[0, 1000]], np.uint16), {"RescaleIntercept": -2048, "PixelPaddingValue": 1000}, [-1000, -1000]),
    ],
)
def test_pixels_that_were_not_imaged_are_air(tmp_path, syntax, pixels, changes, expected):
    image = dicom(0.0, pixels, **changes)
    image.file_meta.TransferSyntaxUID = syntax
    assert read_dicom_series(save(tmp_path, image)).image_hu[0, 0].tolist() == expected


def test_padding_of_signed_pixels_may_be_written_without_its_sign(tmp_path):
    image = dicom(0.0, np.array([[-2000, -500, 7]], np.int16), RescaleSlope=0.25)
    image.add_new("PixelPaddingValue", "US", 65536 - 2000)
    assert read_dicom_series(save(tmp_path, image)).image_hu.tolist() == [[[-1000, -125, 1.75]]]


def test_the_patients_name_is_not_kept(tmp_path):
    series = read_dicom_series(save(tmp_path, dicom(0.0)))
    assert series.description == "CT, ACME, B40f, 120 kVp"
    assert "Secret" not in repr(series)


def test_a_description_needs_nothing(tmp_path):
    folder = save(tmp_path, dicom(0.0, Manufacturer=None, ConvolutionKernel="", KVP=None))
    assert read_dicom_series(folder).description == "CT"


def test_what_is_no_slice_is_passed_over(tmp_path):
    folder = save(
        tmp_path,
        dicom(0.0),
        dicom(9.0, np.ones((9, 9), np.int16), ImageType=["ORIGINAL", "PRIMARY", "LOCALIZER"], SeriesInstanceUID="1.9"),
        dicom(9.0, SOPClassUID=SecondaryCaptureImageStorage, ImagePositionPatient=None),
        dicom(9.0, SOPClassUID=MRImageStorage, Modality="MR"),
        dicom(9.0, SOPClassUID="1.2.840.10008.5.1.4.1.1.481.3", Modality="RTSTRUCT", Rows=None, PixelData=None),
    )
    directory = Dataset()
    directory.FileSetID = "DISC"
    directory.file_meta = FileMetaDataset()
    directory.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
    directory.file_meta.MediaStorageSOPClassUID = MediaStorageDirectoryStorage
    directory.file_meta.MediaStorageSOPInstanceUID = "1.2.3.5"
    directory.save_as(folder / "DICOMDIR", enforce_file_format=True)
    (folder / "LICENSE").write_text("not an image")
    (folder / "empty.txt").touch()
    (folder / "._0.dcm").write_bytes(b"left behind by a Mac")
    (folder / "folder.dcm").mkdir()
    assert read_dicom_series(folder).z == (0.0,)


def test_a_folder_without_ct_images_is_refused(tmp_path):
    (tmp_path / "notes.txt").write_text("nothing")
    with pytest.raises(FileFormatError, match="holds no CT image in DICOM; give the folder that holds the slices"):
        read_dicom_series(tmp_path)
    save(
        tmp_path,
        dicom(0.0, Modality="MR"),
        dicom(1.0, Modality="MR"),
        dicom(1.0, ImageType=["ORIGINAL", "PRIMARY", "LOCALIZER"]),
    )
    with pytest.raises(FileFormatError, match=r"only other images: modality MR \(2\), localizer \(1\)"):
        read_dicom_series(tmp_path)
    with pytest.raises(NotADirectoryError, match="is no folder"):
        read_dicom_series(tmp_path / "notes.txt")


def test_one_of_several_series_must_be_chosen(tmp_path):
    folder = save(tmp_path, dicom(0.0), dicom(3.0), dicom(7.0, SeriesInstanceUID="1.2.4"))
    with pytest.raises(
        FileFormatError, match=r"2 CT series; choose one with --series .*: 1\.2\.3 \(2 images\), 1\.2\.4"
    ):
        read_dicom_series(folder)
    assert read_dicom_series(folder, series_uid="1.2.3").z == (0.0, 3.0)
    assert read_dicom_series(folder, series_uid="1.2.4").z == (7.0,)
    with pytest.raises(FileFormatError, match=r"holds no CT series 1\.2\.5; it holds 1\.2\.3"):
        read_dicom_series(folder, series_uid="1.2.5")


@pytest.mark.parametrize(
    ("heights", "message"),
    [
        ((0.0, 3.0, 9.0, 12.0), "A slice is missing: there is none from z = 3 to 9 mm, where the others are 3 mm"),
        ((0.0, 3.0, 3.0, 6.0), "Two slices are at the same height, z = 3 mm"),
    ],
)
def test_slices_must_follow_without_a_gap(tmp_path, heights, message):
    with pytest.raises(FileFormatError, match=message):
        read_dicom_series(save(tmp_path, *(dicom(z) for z in heights)))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"PixelSpacing": [0.8, 0.8]}, "does not fit 0.dcm: it has 4 x 6 pixels of 0.8 mm along"),
        ({"pixels": np.ones((6, 4), np.int16)}, "does not fit 0.dcm: it has 6 x 4 pixels of 0.7 mm"),
        ({"ImageOrientationPatient": [-1, 0, 0, 0, 1, 0]}, "does not fit 0.dcm: it has .* along"),
        ({"ImagePositionPatient": [-1.0, 1.5, 3.0]}, "lies 3.5 mm beside 0.dcm"),
    ],
)
def test_slices_must_be_alike(tmp_path, changes, message):
    with pytest.raises(FileFormatError, match=message):
        read_dicom_series(save(tmp_path, dicom(0.0), dicom(3.0, **changes)))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"ImageOrientationPatient": [1, 0, 0, 0, 0, -1]}, "axial images are needed"),
        ({"ImageOrientationPatient": [0, 1, 0, 0, 0, -1]}, "axial images are needed"),
        ({"ImageOrientationPatient": [1, 0, 0, 0, 0.9962, -0.0872]}, "does not fit 0.dcm: .* tilted by -5.0 degrees"),
        ({"ImageOrientationPatient": [0.9962, 0, 0.0872, 0, 1, 0]}, "axial images are needed, at most tilted with"),
        ({"ImageOrientationPatient": [1, 0, 0, 0, 0.6, -0.8]}, "axial images are needed"),
        ({"ImageOrientationPatient": [1, 0, 0, 1, 0, 0]}, "axial images are needed"),
        ({"ImageOrientationPatient": None}, "has no ImageOrientationPatient, or not as 6 finite numbers"),
        ({"ImagePositionPatient": [0.0, 0.0]}, "has no ImagePositionPatient, or not as 3 finite numbers"),
        ({"PixelSpacing": [0.7, 0.8]}, "square pixels are needed, got 0.7 x 0.8 mm"),
        ({"PixelSpacing": [0, 0]}, "square pixels are needed"),
        ({"PixelSpacing": ""}, "has no PixelSpacing, or not as 2 finite numbers"),
        ({"RescaleSlope": 1e5}, "are no HU; is the file damaged"),
        ({"RescaleSlope": None}, "has no RescaleSlope, or not as 1 finite numbers"),
        ({"RescaleType": "MGML"}, "in HU was needed, but its values are in MGML"),
        ({"SOPClassUID": EnhancedCTImageStorage, "NumberOfFrames": 2}, "holds 2 frames; export the series"),
        ({"Rows": None}, "has no Rows, or not as 1 finite numbers"),
        ({"PixelData": None}, "not a complete DICOM image"),
        ({"PixelData": b"ab" * 20}, "not a complete DICOM image"),
    ],
)
def test_images_that_are_no_axial_hu_are_refused(tmp_path, changes, message):
    with pytest.raises(FileFormatError, match=message):
        read_dicom_series(save(tmp_path, dicom(0.0), dicom(3.0, **changes)))


def test_compressed_images_without_a_decoder_are_refused(tmp_path):
    image = dicom(3.0, syntax=JPEGLosslessSV1, PixelData=encapsulate([b"no JPEG at all"]))
    with pytest.raises(FileFormatError, match=r"is compressed \(JPEG Lossless.*decompress the series first"):
        read_dicom_series(save(tmp_path, dicom(0.0), image))


@pytest.mark.filterwarnings("ignore:Invalid value for VR UI")
def test_a_file_cut_anywhere_is_refused(tmp_path):
    folder = save(tmp_path, dicom(0.0), dicom(1.0))
    whole = (folder / "1.dcm").read_bytes()
    for length in range(0, len(whole), 5):
        (folder / "1.dcm").write_bytes(whole[:length])
        with pytest.raises(FileFormatError, match=r"1\.dcm.* is not a complete DICOM"):
            read_dicom_series(folder)


def test_a_file_that_may_not_be_read_is_an_error(tmp_path, monkeypatch):
    def denied(*_args, **_kwargs):
        raise PermissionError(errno.EACCES, "Permission denied", "0.dcm")

    folder = save(tmp_path, dicom(0.0))
    monkeypatch.setattr(dicom_open, "dcmread", denied)
    with pytest.raises(PermissionError, match=r"0\.dcm"):
        read_dicom_series(folder)
