import math
from dataclasses import replace

import numpy as np
import pytest

from pnpct.geometry import FanBeam, ImageGrid, VolumeGrid, evenly_spaced_views


def test_the_image_has_y_up_and_its_centre_where_it_is_said_to_be():
    grid = ImageGrid(3, 2, spacing=2.0, center=(10.0, -5.0))
    assert grid.x.tolist() == [9.0, 11.0]
    assert grid.y.tolist() == [-3.0, -5.0, -7.0]
    assert grid.radius == pytest.approx(math.hypot(12.0, 8.0))


def test_the_focal_spot_starts_at_the_top_and_turns_counter_clockwise(geometry: FanBeam):
    quarter = replace(geometry, view_angles=(0.0, math.pi / 2))
    np.testing.assert_allclose(quarter.focal_spots(), [[0.0, 541.0], [-541.0, 0.0]], atol=1e-9)


def test_arc_cells_are_equal_angles_and_flat_cells_equal_lengths(geometry: FanBeam):
    steps = np.diff(geometry.fan_angles)
    np.testing.assert_allclose(steps, 2 * math.atan(6.0 / 949.0))
    assert geometry.fan_angles.mean() == pytest.approx(math.atan(0.25 * 12.0 / 949.0))
    flat = replace(geometry, detector="flat")
    np.testing.assert_allclose(np.diff(np.tan(flat.fan_angles)) * 949.0, 12.0)
    assert np.tan(flat.fan_angles).mean() * 949.0 == pytest.approx(0.25 * 12.0)


@pytest.mark.parametrize("detector", ["arc", "flat"])
def test_rays_run_along_the_stated_direction(geometry: FanBeam, detector):
    geometry = replace(geometry, detector=detector)
    towards = geometry.detector_points(geometry.fan_angles) - geometry.focal_spots()[:, None]
    angle = np.asarray(geometry.view_angles)[:, None] + geometry.fan_angles
    expected = np.stack([np.sin(angle), -np.cos(angle)], axis=-1)
    np.testing.assert_allclose(towards / np.linalg.norm(towards, axis=-1, keepdims=True), expected, atol=1e-12)


def test_a_moving_focal_spot_leaves_the_cells_in_place(geometry: FanBeam):
    shifts = [(0.5, -1.0)] * geometry.views
    moved = replace(geometry, focal_spot_shifts=shifts)
    np.testing.assert_array_equal(
        moved.detector_points(geometry.fan_angles), geometry.detector_points(geometry.fan_angles)
    )
    np.testing.assert_allclose(moved.focal_spots()[0], [0.5, 540.0])


def test_geometries_are_equal_by_value(geometry: FanBeam):
    assert replace(geometry, view_angles=np.asarray(geometry.view_angles)) == geometry
    assert hash(replace(geometry)) == hash(geometry)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"view_angles": ()}, "at least one view"),
        ({"view_angles": (float("nan"),)}, "finite view angles"),
        ({"bins": 0}, "at least one bin, got 0"),
        ({"bin_width": -1.0}, "bin_width must be a positive length in mm, got -1.0"),
        ({"source_to_detector": 500.0}, "beyond the isocentre"),
        ({"detector_offset": float("inf")}, "finite number of bins"),
        ({"focal_spot_shifts": [(0.0, 0.0)]}, "60 views, got 1 shifts"),
        ({"bin_width": 200.0}, "within 90 degrees"),
    ],
)
def test_impossible_fans_are_refused(geometry: FanBeam, change, words):
    with pytest.raises(ValueError, match=words):
        replace(geometry, **change)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((0, 4, 1.0), "got 0 x 4"),
        ((4, 4, 0.0), "positive length in mm, got 0.0"),
        ((4, 4, 1.0, (float("nan"), 0.0)), r"\(x, y\) in mm"),
        ((4, 4, 1e308), "within 1 km of the isocentre, got 4 x 4 pixels of 1e\\+308 mm"),
        ((4, 4, 1.0, (0.0, -1e300)), "within 1 km of the isocentre"),
    ],
)
def test_impossible_grids_are_refused(arguments, words):
    with pytest.raises(ValueError, match=words):
        ImageGrid(*arguments)


def test_no_views_are_refused():
    with pytest.raises(ValueError, match="at least one view, got 0"):
        evenly_spaced_views(0)


def test_slices_lie_around_the_height_of_their_volume():
    grid = VolumeGrid(ImageGrid(3, 2, spacing=2.0), slices=3, slice_spacing=2.5, z=-7.0)
    assert grid.heights.tolist() == [-9.5, -7.0, -4.5]
    assert grid.shape == (3, 3, 2)
    assert str(grid) == "3 slices 2.5 mm apart of 3 x 2 pixels of 2 mm"


@pytest.mark.parametrize(
    ("numbers", "words"),
    [
        ((0, 1.0, 0.0), "at least one slice, got 0"),
        ((1, 0.0, 0.0), "positive length in mm, got 0.0"),
        ((1, 1.0, math.inf), "finite length in mm, got inf"),
        ((3, 1e308, 0.0), "within 1 km of the isocentre, got 3 slices"),
        ((1, 1.0, 1e300), "within 1 km of the isocentre"),
    ],
)
def test_impossible_volumes_are_refused(numbers, words):
    with pytest.raises(ValueError, match=words):
        VolumeGrid(ImageGrid(3, 2, spacing=2.0), *numbers)
