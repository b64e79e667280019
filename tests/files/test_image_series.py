import numpy as np
import pytest

from pnpct.files import FileFormatError, ImageSeries, read_volume
from pnpct.geometry import ImageGrid, VolumeGrid


@pytest.fixture
def volume():
    """No two values are alike."""
    return np.arange(-300, 300, 5, dtype=np.int16).reshape(5, 4, 6)


def described(path, volume, **changes):
    np.savez(path, **{"hu": volume, "z_mm": np.arange(5) * 3.0 - 1, "spacing_mm": np.array([0.8, 0.8]), **changes})
    return path


def test_a_volume_may_say_all_itself(tmp_path, volume):
    series = read_volume(described(tmp_path / "ct.npz", volume))
    assert series.z == (-1.0, 2.0, 5.0, 8.0, 11.0)
    assert series.grid == VolumeGrid(ImageGrid(4, 6, spacing=0.8), slices=5, slice_spacing=3.0, z=5.0)
    assert series.image_hu.dtype == np.int16
    np.testing.assert_array_equal(series.image_hu, volume)


def test_slices_from_the_head_to_the_feet_are_turned(tmp_path, volume):
    series = read_volume(described(tmp_path / "ct.npz", volume, z_mm=np.array([9, 7, 5, 3, 1]), spacing_mm=0.8))
    assert series.z == (1.0, 3.0, 5.0, 7.0, 9.0)
    np.testing.assert_array_equal(series.image_hu, volume[::-1])


@pytest.mark.parametrize("name", ["ct.npy", "ct.npz:volume"])
def test_a_plain_array_needs_its_spacings(tmp_path, volume, name):
    np.save(tmp_path / "ct.npy", volume)
    np.savez(tmp_path / "ct.npz", volume=volume, other=volume)
    path = f"{tmp_path}/{name}"
    series = read_volume(path, pixel_spacing=0.5, slice_spacing=2.0)
    assert series.z == (-4.0, -2.0, 0.0, 2.0, 4.0)
    assert series.grid == VolumeGrid(ImageGrid(4, 6, spacing=0.5), slices=5, slice_spacing=2.0)
    np.testing.assert_array_equal(series.image_hu, volume)
    with pytest.raises(ValueError, match="has no spacings; give pixel_spacing and slice_spacing in mm"):
        read_volume(path)
    with pytest.raises(ValueError, match="needs both of them"):
        read_volume(path, pixel_spacing=0.5)
    with pytest.raises(ValueError, match="slice_spacing must be a positive length in mm, got 0"):
        read_volume(path, pixel_spacing=0.5, slice_spacing=0.0)


@pytest.mark.parametrize(
    ("dtype", "kept"),
    [(np.int16, np.int16), (np.int32, np.int16), (np.uint16, np.int16), (np.float64, np.float32)],
)
def test_numbers_are_kept_as_small_as_they_can_be(tmp_path, dtype, kept):
    np.save(tmp_path / "ct.npy", np.full((2, 2, 2), 100, dtype))
    series = read_volume(tmp_path / "ct.npy", pixel_spacing=1.0, slice_spacing=1.0)
    assert series.image_hu.dtype == kept
    assert (series.image_hu == 100).all()


@pytest.mark.parametrize("dtype", [np.int16, np.int32, np.float64])
def test_padding_becomes_air(tmp_path, dtype):
    padding = -32768 if dtype == np.int16 else -100000
    np.save(tmp_path / "ct.npy", np.array([[[padding, -1025, -1024, 30]]], dtype))
    series = read_volume(tmp_path / "ct.npy", pixel_spacing=1.0, slice_spacing=1.0)
    assert series.image_hu.tolist() == [[[-1000, -1000, -1024, 30]]]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"spacing_mm": np.array([0.8, 0.9])}, "square pixels are needed, got 0.8 x 0.9 mm"),
        ({"spacing_mm": np.array([0.8, 0.8, 3.0])}, "spacing_mm must hold one or two lengths"),
        ({"spacing_mm": -0.8}, "pixel spacing must be a positive length"),
        ({"z_mm": np.arange(4.0)}, r"4 slices on this grid have the shape \(4, 4, 6\), got \(5, 4, 6\)"),
        ({"z_mm": np.array([0.0, 1.0, 2.0, 4.0, 5.0])}, "A slice is missing: there is none from z = 2 to 4 mm"),
        ({"z_mm": np.array([0.0, 1.0, 1.0, 2.0, 3.0])}, "Two slices are at the same height, z = 1 mm"),
        ({"z_mm": np.array([0.0, 2.0, 1.0, 3.0, 4.0])}, "must grow, but z = 1 mm follows on 2 mm"),
        ({"hu": np.zeros((4, 6))}, r"\[slices, rows, cols\] was needed, got the shape \(4, 6\)"),
        ({"hu": np.full((5, 4, 6), 1e300)}, r"values from 1e\+300 to 1e\+300 are no HU"),
        ({"spacing_mm": np.array(6e-4)}, "an image of 0.0036 mm, .*distances of its pixels in m"),
        ({"hu": np.full((5, 4, 6), 1.02)}, "the values go from 1.02 to 1.02; are they in another unit"),
    ],
)
def test_volumes_that_do_not_fit_together_are_refused(tmp_path, volume, changes, message):
    with pytest.raises(FileFormatError, match=message):
        read_volume(described(tmp_path / "ct.npz", volume, **changes))


def test_missing_arrays_are_named(tmp_path, volume):
    np.savez(tmp_path / "ct.npz", volume=volume)
    with pytest.raises(FileFormatError, match=r"has no array hu; it has volume\. A volume is read from hu, z_mm and"):
        read_volume(tmp_path / "ct.npz")
    with pytest.raises(FileNotFoundError):
        read_volume(tmp_path / "none.npz")


def test_a_series_needs_finite_values_and_a_slice():
    grid = ImageGrid(2, 2, spacing=1.0)
    with pytest.raises(ValueError, match="must be finite HU"):
        ImageSeries(np.full((1, 2, 2), np.nan, np.float32), grid, (0.0,), "")
    with pytest.raises(ValueError, match="at least one slice"):
        ImageSeries(np.zeros((0, 2, 2), np.int16), grid, (), "")
    with pytest.raises(ValueError, match="finite lengths"):
        ImageSeries(np.zeros((1, 2, 2), np.int16), grid, (float("nan"),), "")
