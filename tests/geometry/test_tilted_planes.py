import math
from dataclasses import replace

import numpy as np
import pytest

from pnpct.geometry import ConeBeam, Detector, TiltedPlanes, Trajectory

TURN = 2 * math.pi
DETECTOR = Detector(bins=60, bin_width=15.0, offset=0.25, rows=16, row_height=1.1)


def helix(feed: float = 20.0, *, turns: float = 3.0, views: int = 96, start: float = 1.0, sense: int = 1) -> ConeBeam:
    angles = start + sense * TURN / views * np.arange(round(turns * views))
    return ConeBeam(Trajectory(angles, z=feed * angles / TURN + 5.0), DETECTOR, 541.0, 949.0)


@pytest.mark.parametrize("feed", [20.0, -35.0])
@pytest.mark.parametrize("sense", [1, -1])
def test_the_plane_meets_the_helix_at_its_central_angle_and_60_degrees_beside(feed, sense):
    planes = TiltedPlanes(helix(feed, sense=sense))
    assert planes.feed == pytest.approx(feed)
    z = sum(planes.reach) / 2
    plane = planes.stack_at(z).planes[0]
    central = TURN * (z - 5.0) / feed
    for angle in central + np.radians([-60.0, 0.0, 60.0]):
        x, y = -541.0 * math.sin(angle), 541.0 * math.cos(angle)
        assert plane.heights(np.array([x]), np.array([y])) == pytest.approx(feed * angle / TURN + 5.0)


@pytest.mark.parametrize("rebinning", ["tilted", "single-slice"])
def test_the_views_are_those_around_the_central_angle(rebinning):
    geometry = helix()
    planes = TiltedPlanes(geometry, rebinning)
    z = 30.0
    views = planes.views(planes.stack_at(z))
    fan = 180.0 + 2 * math.degrees(max(np.abs(geometry.fan_angle_edges))) if rebinning == "tilted" else 360.0
    after = np.degrees(np.asarray(geometry.trajectory.angles)[views]) - 360 / 20 * (z - 5.0)
    assert after.min() == pytest.approx(-fan / 2, abs=360 / 96)
    assert after.max() == pytest.approx(fan / 2, abs=360 / 96)
    assert len(views) == pytest.approx(fan / 360 * 96, abs=1)
    assert planes.fan(views).bins == geometry.bins


def test_slices_a_turn_apart_have_one_fan_beam_and_views_in_the_order_of_their_angles():
    planes = TiltedPlanes(helix())
    stacks = planes.stacks(*planes.reach, spacing=0.6)
    fans = [planes.fan(planes.views(stack)) for stack in stacks]
    assert len(stacks) > 32
    assert len(set(fans)) == 16
    assert fans[0] == fans[16] == fans[32]
    mixed = replace(planes.geometry, trajectory=planes.geometry.trajectory[slice(None, None, -1)])
    assert [TiltedPlanes(mixed).fan(TiltedPlanes(mixed).views(stack)) for stack in stacks] == fans


@pytest.mark.parametrize("feed", [20.0, -20.0])
def test_stacks_go_evenly_from_below_the_lowest_slice_to_above_the_highest(feed):
    planes = TiltedPlanes(helix(feed))
    low, high = planes.reach
    all_of_them = [plane.z for stack in planes.stacks(low, high, spacing=0.5) for plane in stack.planes]
    steps = np.diff(all_of_them)
    np.testing.assert_allclose(steps, steps[0])
    assert 0 < steps[0] <= 0.5
    assert low < all_of_them[0] < low + 0.5
    assert high - 0.5 < all_of_them[-1] < high
    some = [plane.z for stack in planes.stacks(low + 5.0, high - 5.0, spacing=0.5) for plane in stack.planes]
    assert some[0] <= low + 5.0
    assert some[-1] >= high - 5.0
    assert len(some) < len(all_of_them)
    assert set(some) <= set(all_of_them)


def test_a_circle_has_horizontal_planes_near_its_own():
    circle = replace(helix(), trajectory=Trajectory(TURN / 96 * np.arange(96), z=[7.0] * 96))
    planes = TiltedPlanes(circle)
    half = 7.5 * circle.row_height_at_isocenter
    assert planes.reach == pytest.approx((7.0 - half, 7.0 + half))
    stacks = planes.stacks(5.0, 9.5, spacing=0.5)
    np.testing.assert_allclose([plane.z for stack in stacks for plane in stack.planes], np.arange(5.0, 9.6, 0.5))
    assert all(plane.slope == (0.0, 0.0) for stack in stacks for plane in stack.planes)
    assert all(len(planes.views(stack)) == 96 for stack in stacks)


def test_what_has_no_planes():
    wrapped = replace(helix().trajectory, angles=np.mod(helix().trajectory.angles, TURN))
    with pytest.raises(ValueError, match="heights grow evenly with its angles"):
        TiltedPlanes(replace(helix(), trajectory=wrapped))
    with pytest.raises(ValueError, match=r"needs the views of 0\.\d+ turns of a helix, but this one has 0\.50 turns"):
        _ = TiltedPlanes(helix(turns=0.5)).reach
    planes = TiltedPlanes(helix())
    with pytest.raises(ValueError, match="needs views that were not measured"):
        planes.views(planes.stack_at(planes.reach[0] - 2.0))


def test_slices_beside_missing_views_are_made_and_those_that_need_them_are_not():
    whole = helix(turns=5.0)
    gap = replace(whole, trajectory=whole.trajectory[[*range(300), *range(310, 480)]])
    planes = TiltedPlanes(gap)
    low, high = planes.reach
    for at in (low + 2.0, high - 2.0):
        made, wanted = (each.stacks(at, at, spacing=0.6) for each in (planes, TiltedPlanes(whole)))
        assert [stack.center for stack in made] == [stack.center for stack in wanted]
    missing = TURN / 96 * np.array([299, 310]) + 1.0
    below, above = 20.0 * missing / TURN + 5.0
    with pytest.raises(ValueError, match=rf"between z = {below:.4g} and {above:.4g} mm, which are missing"):
        planes.stacks(low, high, spacing=0.6)
    every_third = replace(whole, trajectory=whole.trajectory[[view for view in range(480) if view % 3]])
    assert TiltedPlanes(every_third).stacks(low, high, spacing=0.6)
