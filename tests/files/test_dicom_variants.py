"""CT images in DICOM that are unusual, and read."""

import numpy as np
import pytest
from dicom_images import COLS, ROWS, STANDARD, dicom, save, stored_pixels
from pydicom import Dataset
from pydicom.uid import EnhancedCTImageStorage, ExplicitVRLittleEndian, ImplicitVRLittleEndian

from pnpct.files import FileFormatError, evenly_spaced, read_dicom_series, read_source_series


def plain_phantom(x, y, z):
    """A ramp, which linear interpolation leaves as it is: HU at positions of the patient, mm."""
    return 4 * x - 6 * y + 10 * z


@pytest.mark.parametrize("turned", [1, -1])
@pytest.mark.parametrize("degrees", [-20.0, 0.5, 20.0])
def test_a_tilted_series_becomes_axial_in_the_same_place(tmp_path, degrees, turned):
    rise, level = np.sin(np.radians(degrees)), np.cos(np.radians(degrees))
    directions = [float(turned), 0, 0, 0, turned * level, turned * rise]
    rows, cols, spacing = 40, 6, 2.0
    row, col = np.mgrid[:rows, :cols]
    images = []
    for z in range(-18, 19, 3):
        x, y = -5 + turned * col * spacing, 7 + turned * row * spacing * level
        pixels = np.rint(plain_phantom(x, y, z + turned * row * spacing * rise)).astype(np.int16)
        images.append(
            dicom(
                float(z),
                pixels,
                ImageOrientationPatient=[f"{value:.10g}" for value in directions],
                ImagePositionPatient=[-5, 7, z],
                PixelSpacing=[spacing, spacing],
            )
        )
    series = read_dicom_series(save(tmp_path, *images))
    assert len(series.notes) == 1
    assert f"tilted by {abs(degrees):.1f} degrees" in series.notes[0]
    x, y, z = (np.asarray(axis) for axis in (series.plane.x, -series.plane.y, series.z))
    expected = plain_phantom(x, y[:, None], z[:, None, None])
    imaged = series.image_hu != -1000
    np.testing.assert_allclose(series.image_hu[imaged], expected[imaged], atol=1.01)
    assert imaged[len(z) // 2].all()
    assert (rows * level - 1) <= series.plane.rows <= rows
    # The middle of the first image, by hand: nothing but the height of its plane changes.
    assert series.z[0] == pytest.approx(-18 + turned * rise * spacing * (rows - 1) / 2, abs=1e-4)


def test_a_single_tilted_image_stays_in_its_plane(tmp_path):
    tilted = dicom(0.0, ImageOrientationPatient=[1, 0, 0, 0, 0.9962, 0.0872])
    with pytest.raises(FileFormatError, match="single image of a tilted gantry cannot be made axial; give the whole"):
        read_dicom_series(save(tmp_path, tilted))
    np.testing.assert_array_equal(read_source_series(tmp_path).image_hu[0], stored_pixels(0.0))


def test_slices_at_uneven_distances_are_read_and_made_even(tmp_path):
    heights = (0.0, 2.0, 4.0, 6.0, 10.0, 14.0)
    pixels = {z: np.full((ROWS, COLS), 10 * z, np.int16) for z in heights}
    series = read_dicom_series(save(tmp_path, *(dicom(z, pixels[z]) for z in heights)))
    assert series.z == heights
    with pytest.raises(ValueError, match="not evenly spaced; resample it with evenly_spaced"):
        series.grid  # noqa: B018 - it is reckoned when it is asked for
    even = evenly_spaced(series)
    assert even.grid.heights.tolist() == [0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0]
    np.testing.assert_allclose(even.image_hu[:, 0, 0], 10 * even.grid.heights)
    assert even.notes == ("The slices are 2 to 4 mm apart: they were resampled to even distances of 2 mm.",)


def test_rounded_positions_are_even(tmp_path):
    series = read_dicom_series(save(tmp_path, *(dicom(z) for z in (0.0, 0.62, 1.25, 1.87, 2.5))))
    assert evenly_spaced(series) is series
    assert series.grid.slice_spacing == 0.625


def item(**elements: object) -> Dataset:
    result = Dataset()
    for name, value in elements.items():
        setattr(result, name, value)
    return result


def enhanced(heights, **changes: object) -> Dataset:
    """An enhanced CT image; spacing and orientation are shared, each frame has a position and an intercept."""
    image = dicom(0.0, np.stack([stored_pixels(z) for z in heights]), SOPClassUID=EnhancedCTImageStorage)
    image.Rows, image.Columns, image.NumberOfFrames = ROWS, COLS, len(heights)
    for name in ("PixelSpacing", "ImageOrientationPatient", "ImagePositionPatient", "RescaleSlope", "RescaleIntercept"):
        delattr(image, name)
    measures = item(PixelSpacing=[0.7, 0.7], SliceThickness=3.0)
    image.SharedFunctionalGroupsSequence = [
        item(
            PixelMeasuresSequence=[measures],
            PlaneOrientationSequence=[item(ImageOrientationPatient=STANDARD)],
        )
    ]
    image.PerFrameFunctionalGroupsSequence = [
        item(
            PlanePositionSequence=[item(ImagePositionPatient=[-1.0, -2.0, z])],
            PixelValueTransformationSequence=[item(RescaleSlope=1, RescaleIntercept=round(z), RescaleType="HU")],
        )
        for z in heights
    ]
    for name, value in changes.items():
        setattr(image, name, value)
    return image


def test_the_frames_of_an_enhanced_image_are_slices(tmp_path):
    heights = (6.0, 0.0, 3.0)
    series = read_dicom_series(save(tmp_path, enhanced(heights)))
    assert series.z == (0.0, 3.0, 6.0)
    assert (series.plane.spacing, series.slice_thickness) == (0.7, 3.0)
    np.testing.assert_array_equal(series.image_hu, [stored_pixels(z) + round(z) for z in series.z])
    source = read_source_series(tmp_path)
    references = [elements["SourceImageSequence"][0].ReferencedFrameNumber for elements in source.elements()]
    assert references == [2, 3, 1]


def test_frames_without_their_groups_are_refused(tmp_path):
    image = enhanced((0.0, 3.0), PerFrameFunctionalGroupsSequence=[])
    with pytest.raises(FileFormatError, match="holds 2 frames; export the series as one image per file"):
        read_dicom_series(save(tmp_path, image))


@pytest.mark.parametrize("syntax", [ExplicitVRLittleEndian, ImplicitVRLittleEndian])
@pytest.mark.parametrize("named", [False, True])
def test_files_without_preamble_are_read(tmp_path, syntax, named):
    folder = save(tmp_path, *(dicom(z) for z in (0.0, 3.0)))
    for z in (0, 1):
        image = dicom(3.0 * z, syntax=syntax)
        if not named:
            del image.file_meta
        implicit = syntax == ImplicitVRLittleEndian
        image.save_as(folder / f"{z}.dcm", implicit_vr=implicit, little_endian=True, enforce_file_format=False)
    assert b"DICM" not in (folder / "0.dcm").read_bytes()
    series = read_dicom_series(folder)
    np.testing.assert_array_equal(series.image_hu, np.stack([stored_pixels(z) for z in series.z]))
    whole = (folder / "0.dcm").read_bytes()
    for length in range(0, len(whole), 40):
        (folder / "0.dcm").write_bytes(whole[:length])
        with pytest.raises(FileFormatError, match=r"0\.dcm.* is not a complete DICOM"):
            read_dicom_series(folder)
