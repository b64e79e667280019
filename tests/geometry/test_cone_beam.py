import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from pnpct.geometry import ConeBeam, Detector, FanBeam, ImageGrid, Trajectory, require_fan_beam, view_numbers
from pnpct.operators import Projector

HELIX = ConeBeam(
    Trajectory(
        angles=[0.5 * math.pi * view for view in range(6)],
        z=[2.0 * view - 5.0 for view in range(6)],
        focal_spot_shifts=[(0.1 * view, -0.5, 0.25 * (view % 2)) for view in range(6)],
    ),
    Detector(bins=5, bin_width=20.0, offset=0.25, rows=4, row_height=1.5, row_offset=0.5),
    source_to_isocenter=500.0,
    source_to_detector=1000.0,
)

SUBSETS = {
    "slice": (slice(1, None, 2), [1, 3, 5]),
    "numbers": (np.array([4, 0, 4]), [4, 0, 4]),
    "list, from the end": ([-1, 2], [5, 2]),
    "mask": (np.array([True, False, False, True, True, False]), [0, 3, 4]),
}


@pytest.fixture
def fan(geometry: FanBeam) -> FanBeam:
    return replace(geometry, focal_spot_shifts=[(0.3 * (view % 3), 0.1 * view) for view in range(geometry.views)])


def test_a_helix_worked_by_hand():
    spots = HELIX.focal_spots()
    # View 0 at the top, shifted towards the axis by 0.5; view 1 at the left, where the fan grows upwards.
    np.testing.assert_allclose(spots[0], [0.0, 499.5, -5.0], atol=1e-9)
    np.testing.assert_allclose(spots[1], [-499.5, 0.1, -2.75], atol=1e-9)
    central = HELIX.detector_points(np.zeros(1))
    np.testing.assert_allclose(central[0, 0], [0.0, -500.0, -5.0], atol=1e-9)
    np.testing.assert_allclose(central[1, 0], [500.0, 0.0, -3.0], atol=1e-9)
    assert HELIX.detector.row_positions.tolist() == [-1.5, 0.0, 1.5, 3.0]
    assert HELIX.detector.row_edges.tolist() == [-2.25, -0.75, 0.75, 2.25, 3.75]
    assert HELIX.row_height_at_isocenter == 0.75
    assert HELIX.shape == (6, 4, 5)


@pytest.mark.parametrize("detector", ["arc", "flat"])
def test_a_fan_beam_is_a_cone_beam_of_one_row(fan, detector):
    fan = replace(fan, detector=detector)
    cone = fan.cone_beam
    assert cone.shape == (fan.views, 1, fan.bins)
    np.testing.assert_array_equal(cone.focal_spots()[:, :2], fan.focal_spots())
    np.testing.assert_array_equal(cone.focal_spots()[:, 2], 0.0)
    np.testing.assert_array_equal(cone.fan_angles, fan.fan_angles)
    np.testing.assert_array_equal(cone.detector.row_positions, [0.0])
    assert FanBeam.from_cone_beam(cone) == fan


def test_a_row_of_an_axial_scan_is_a_fan_beam_wherever_the_table_is(fan):
    rows = replace(fan.cone_beam.detector, rows=32, row_height=1.1)
    raised = replace(fan.cone_beam.trajectory, z=[12.5] * fan.views)
    assert FanBeam.from_cone_beam(replace(fan.cone_beam, detector=rows, trajectory=raised)) == fan


def test_a_helix_is_no_fan_beam():
    with pytest.raises(ValueError, match=r"focal spot moves from z = -5 to 5\.25 mm"):
        FanBeam.from_cone_beam(HELIX)
    with pytest.raises(ValueError, match=r"A fan beam is needed.* of 4 detector rows at z = -5 to 5 mm;"):
        require_fan_beam(HELIX)
    with pytest.raises(ValueError, match="at z = 0 mm"):
        require_fan_beam(replace(HELIX, trajectory=Trajectory([0.0])))


@pytest.mark.parametrize("name", SUBSETS)
def test_a_subset_of_the_views_has_their_focal_spots_and_cells(name):
    views, numbers = SUBSETS[name]
    part = HELIX[views]
    assert part.shape == (len(numbers), 4, 5)
    np.testing.assert_array_equal(part.focal_spots(), HELIX.focal_spots()[numbers])
    np.testing.assert_array_equal(
        part.detector_points(part.fan_angles), HELIX.detector_points(part.fan_angles)[numbers]
    )


@pytest.mark.parametrize("moving", [True, False])
@pytest.mark.parametrize("views", [slice(5, None, 3), [7, 7, -2], np.arange(60) % 4 == 1])
def test_a_subset_of_the_views_projects_to_a_subset_of_the_rays(geometry, fan, grid, disk, views, moving):
    whole = fan if moving else geometry
    numbers = np.arange(60)[views]
    rays = Projector(grid, whole[views])(disk)
    torch.testing.assert_close(rays, Projector(grid, whole)(disk)[numbers], rtol=1e-5, atol=1e-5)


def test_all_views_in_their_order_are_the_geometry(fan):
    assert HELIX[:] == HELIX
    assert fan[:] == fan
    assert hash(HELIX[:]) == hash(HELIX)


@pytest.mark.parametrize(
    ("views", "error", "words"),
    [
        (slice(3, 3), IndexError, "at least one of the 6 views, but none"),
        ([6], IndexError, "out of bounds"),
        (np.zeros(5, bool), IndexError, "boolean"),
        (np.zeros((2, 2), int), TypeError, "a slice, a list of numbers, or a mask"),
    ],
)
def test_impossible_subsets_are_refused(views, error, words):
    with pytest.raises(error, match=words):
        view_numbers(views, 6)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"rows": 0}, "at least one row, got 0"),
        ({"row_height": 0.0}, r"row_height must be a positive length in mm where .*, got 0\.0 for 4"),
        ({"row_height": -1.0, "rows": 1}, r"got -1\.0 for 1"),
        ({"row_offset": math.nan}, "row_offset must be a finite number of rows"),
    ],
)
def test_impossible_detectors_are_refused(change, words):
    with pytest.raises(ValueError, match=words):
        replace(HELIX.detector, **change)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"z": (1.0, 2.0)}, "6 views, got 2 heights"),
        ({"z": (math.inf,) * 6}, "heights of views must be finite"),
        ({"focal_spot_shifts": [(0.0, 0.0, 0.0)]}, "6 views, got 1 shifts"),
        ({"focal_spot_shifts": [(0.0, 0.0, math.nan)] * 6}, "shifts must be finite"),
    ],
)
def test_impossible_trajectories_are_refused(change, words):
    with pytest.raises(ValueError, match=words):
        replace(HELIX.trajectory, **change)


def test_geometries_say_what_they_are(geometry):
    assert str(HELIX) == "6 views of 4 rows of 5 bins on an arc"
    assert str(geometry) == "60 views of 48 bins on an arc"
    assert str(replace(geometry, detector="flat")) == "60 views of 48 bins on a flat detector"
    assert str(ImageGrid(3, 4, 0.5)) == "3 x 4 pixels of 0.5 mm"
