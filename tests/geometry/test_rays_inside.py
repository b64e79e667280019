from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest
from cone_worlds import CIRCLE, HELIX, MOVING, PLANE

from pnpct.geometry import VolumeGrid, rays_inside, slices_beyond, views_meeting


def heights_within(geometry, plane) -> np.ndarray:
    """Heights of the edges of all cells' rays where they are within the circle: (views, edges, bins, points)."""
    spots, cells = geometry.focal_spots(), geometry.detector_points(geometry.fan_angles)
    t = np.linspace(0.0, 1.0, 401)
    across = spots[:, None, None, :2] + t[:, None] * (cells - spots[:, None])[:, :, None, :2]
    radius = min(plane.radius, geometry.field_of_view_radius)
    within = (np.hypot(across[..., 0], across[..., 1]) <= radius)[:, None]
    rise = geometry.trajectory.heights[:, None] - spots[:, 2:] + geometry.detector.row_edges
    z = spots[:, 2, None, None, None] + rise[..., None, None] * t
    return np.where(within, z, np.nan)


@pytest.mark.parametrize("geometry", [CIRCLE, HELIX, MOVING], ids=["circle", "helix", "moving"])
@pytest.mark.filterwarnings("ignore:All-NaN slice")
def test_rays_inside_never_leave_the_volume(geometry):
    grid = VolumeGrid(PLANE, 10, 5.0, z=4.0)
    z = heights_within(geometry, PLANE)
    low, high = np.nanmin(z, axis=-1), np.nanmax(z, axis=-1)
    inside = rays_inside(grid, geometry)
    assert inside.any()
    assert not inside.all()
    faces = 4.0 - 25.0, 4.0 + 25.0
    for edges in (slice(1, None), slice(None, -1)):  # where the circle is sampled, no edge of an inner cell is outside
        outside = (low[:, edges] < faces[0]) | (high[:, edges] > faces[1])
        assert not (inside & outside).any()
    almost = (low > faces[0] + 0.5) & (high < faces[1] - 0.5)
    assert inside[almost[:, 1:] & almost[:, :-1]].all()


@pytest.mark.filterwarnings("ignore:All-NaN slice")
def test_no_ray_that_meets_the_slices_leaves_those_added():
    asked = VolumeGrid(PLANE, 4, 3.0, z=-2.0)
    more = slices_beyond(asked, HELIX)
    z = heights_within(HELIX, PLANE)
    meets = ((z[:, 1:] > -8.0) & (z[:, :-1] < 4.0)).any(-1)
    assert rays_inside(replace(asked, slices=4 + 2 * more + 2), HELIX)[meets].all()
    assert not rays_inside(replace(asked, slices=4 + more), HELIX)[meets].all()
    low = replace(asked, z=-60.0)
    meets = ((z[:, 1:] > -66.0) & (z[:, :-1] < -54.0)).any((1, 2, 3))
    views = views_meeting(low, HELIX)
    assert set(np.flatnonzero(meets)) <= set(views.tolist()) < set(range(HELIX.views))
    assert len(views_meeting(low, HELIX, within=1000.0)) == HELIX.views


@pytest.mark.parametrize("geometry", [CIRCLE, HELIX, MOVING], ids=["circle", "helix", "moving"])
def test_views_are_followed_some_at_a_time(geometry, monkeypatch):
    grid = VolumeGrid(PLANE, 6, 2.0)
    at_once = rays_inside(grid, geometry)
    monkeypatch.setattr(import_module("pnpct.geometry.rays_inside"), "_TOGETHER", 7)
    assert 0 < at_once.sum() < at_once.size
    assert (rays_inside(grid, geometry) == at_once).all()
