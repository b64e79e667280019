"""What a helix and an axial scan cover."""

import math
from dataclasses import replace

import numpy as np
import pytest

from pnpct.geometry import ConeBeam, Coverage, Detector, Trajectory

DETECTOR = Detector(40, 20.0, rows=32, row_height=1.1, row_offset=0.5)
RADIUS, DISTANCE = 541.0, 949.0
COLLIMATION = 32 * 1.1 * RADIUS / DISTANCE


def helix(*, turns=3.0, feed=20.0, views=100, shifts=()):
    angles = np.arange(round(turns * views)) * 2 * math.pi / views
    trajectory = Trajectory(angles, feed * angles / (2 * math.pi), shifts)
    return ConeBeam(trajectory, DETECTOR, RADIUS, DISTANCE)


@pytest.mark.parametrize("feed", [20.0, -27.5])
@pytest.mark.parametrize("direction", [1, -1])
def test_feed_and_pitch_of_a_helix(feed, direction):
    geometry = helix(feed=feed)
    trajectory = geometry.trajectory
    angles = [direction * angle for angle in trajectory.angles]
    cover = Coverage(replace(geometry, trajectory=replace(trajectory, angles=angles)))
    assert cover.turns == pytest.approx(3.0)
    assert cover.feed == pytest.approx(feed)
    assert cover.pitch == pytest.approx(abs(feed) / COLLIMATION)


def test_slices_of_a_helix_have_half_a_turn_and_a_fan_around_them():
    geometry = helix(feed=20.0)
    low, high = Coverage(geometry).slices
    needed = math.pi + 2 * abs(geometry.fan_angle_edges[0])
    angles = np.asarray(geometry.trajectory.angles)
    at = low / 20.0 * 2 * math.pi
    assert at - needed / 2 == pytest.approx(angles[0])
    assert high / 20.0 * 2 * math.pi + needed / 2 == pytest.approx(angles[-1])
    assert Coverage(helix(turns=0.6)).slices is None


def test_slices_of_an_axial_scan_are_those_that_the_rows_see():
    cover = Coverage(helix(turns=1.0, feed=0.0))
    assert (cover.feed, cover.pitch) == (0.0, 0.0)
    middle = 0.5 * COLLIMATION / 32
    assert cover.slices == pytest.approx((middle - COLLIMATION / 2, middle + COLLIMATION / 2))


@pytest.mark.parametrize("views", [1, 30, 59])
def test_an_axial_scan_of_less_than_half_a_turn_and_a_fan_has_no_slice(views):
    circle = helix(turns=1.0, feed=0.0)
    assert math.degrees(circle.short_scan) == pytest.approx(180 + 48.3, abs=0.01)
    assert Coverage(circle[:views]).slices is None
    assert Coverage(circle[:64]).slices == Coverage(circle).slices


@pytest.mark.parametrize(
    ("first", "second", "mode"),
    [
        ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), "FFSNONE"),
        ((-0.2, 0.0, 0.0), (-0.2, 0.0, 0.0), "FFSNONE"),
        ((-0.2, 0.0, 0.0), (-0.2018, 5.4, -0.66), "FFSZ"),
        ((-0.4, 0.0, 0.0), (0.4, 0.0, 0.0), "FFSXY"),
        ((-0.4, 0.0, 0.0), (0.4, 5.4, -0.66), "FFSXYZ"),
    ],
)
def test_the_way_that_the_focal_spot_flies(first, second, mode):
    assert Coverage(helix(turns=1.0, shifts=[first, second] * 50)).focal_spot_mode == mode
