"""Which rays of a cone beam stay inside a volume, and how far those go beyond its slices that meet them.

Within the circle that the fan covers, a ray of slope m rises by m · chord. So of all rays that meet some slices none
leaves them by more than the steepest slope times the diameter of the circle.
"""

import math

import numpy as np
from numpy.typing import NDArray

from pnpct.geometry.cone_beam import ConeBeam
from pnpct.geometry.image_grid import ImageGrid
from pnpct.geometry.volume_grid import VolumeGrid

_TOGETHER = 128
"""Views whose rays are followed together: their heights are many times larger than the answer."""


def slices_beyond(grid: VolumeGrid, geometry: ConeBeam) -> int:
    """Return how many slices the rays that meet those of a volume reach beyond its lowest, and beyond its highest."""
    rise = _steepest(geometry) * 2 * _radius(grid.plane, geometry)
    return math.ceil(rise / grid.slice_spacing - 1e-6)


def views_meeting(grid: VolumeGrid, geometry: ConeBeam, *, within: float = 0.0) -> NDArray[np.int64]:
    """Return the numbers of the views whose rays may meet the slices of a volume.

    Args:
        grid: The volume.
        geometry: All views.
        within: Views are returned too whose focal spot is so near to the slices, mm.
    """
    rise = _steepest(geometry) * (geometry.source_to_isocenter + _radius(grid.plane, geometry))
    beyond = grid.slice_spacing / 2 + max(rise, within)
    spots, low, high = geometry.focal_spots()[:, 2], grid.heights[0] - beyond, grid.heights[-1] + beyond
    numbers: NDArray[np.int64] = np.flatnonzero((spots > low) & (spots < high))
    return numbers


def rays_inside(grid: VolumeGrid, geometry: ConeBeam) -> NDArray[np.bool_]:
    """Return whether each ray, with its whole cell, is between the lowest and the highest face of a volume.

    What is outside the circle that the fan covers, or outside that around the image, counts as air.

    Returns:
        (views, rows, bins).
    """
    blocks = (geometry[first : first + _TOGETHER] for first in range(0, geometry.views, _TOGETHER))
    return np.concatenate([_inside(grid, block) for block in blocks])


def _inside(grid: VolumeGrid, geometry: ConeBeam) -> NDArray[np.bool_]:
    spots = geometry.focal_spots()
    along = geometry.detector_points(geometry.fan_angles)[..., :2] - spots[:, None, :2]
    distance = np.linalg.norm(along, axis=-1)
    nearest = -(along * spots[:, None, :2]).sum(-1) / distance
    aside = (spots[:, :2] ** 2).sum(-1)[:, None] - nearest**2
    half_chord = np.sqrt(np.maximum(_radius(grid.plane, geometry) ** 2 - aside, 0.0))
    rise = geometry.trajectory.heights[:, None] - spots[:, 2:] + geometry.detector.row_edges
    face = grid.slices * grid.slice_spacing / 2
    inside = np.ones((geometry.views, geometry.rows + 1, geometry.bins), dtype=bool)
    for end in (nearest - half_chord, nearest + half_chord):
        # z = z_spot + rise · part of the way
        z = spots[:, 2, None, None] + rise[..., None] * (end / distance)[:, None]
        inside &= np.abs(z - grid.z) <= face
    return inside[:, 1:] & inside[:, :-1]


def _steepest(geometry: ConeBeam) -> float:
    above = geometry.trajectory.heights - geometry.focal_spots()[:, 2]
    edges = geometry.detector.row_edges[[0, -1]]
    return float(np.abs(above[:, None] + edges).max()) / geometry.source_to_detector


def _radius(plane: ImageGrid, geometry: ConeBeam) -> float:
    return min(plane.radius, geometry.field_of_view_radius)
