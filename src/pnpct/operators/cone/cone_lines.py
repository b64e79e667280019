"""The mathematics of rays in a cone beam: the only place where one meets a volume.

Seen along the axis the rays of all detector rows are those of one fan beam, and `ray_lines` tabulates their strips. A
ray to height v of the detector is at the height z_s + t (z_c + v − z_s) at the part t of its way, z_s the height of the
focal spot and z_c that of the view: t is linear in the rows of the image that the ray crosses. So on each row the edges
of the detector rows cut the slices at even distances

    e_j = low + t (rise + j step),   j = 0 … detector rows,

in slices from the lower face of the volume. Rows of the image that are neighbours share one t, and so do cells.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pnpct.geometry import ConeBeam, FanBeam, Trajectory, VolumeGrid
from pnpct.operators.ray_lines import RayLines, check_reach, frame_lines

Array = NDArray[np.float32]

BENT = 0.3
"""Detector rows by which a ray may leave its height where rows of the image share one t."""

MOST_TOGETHER = 8
"""Rows of the image that share one t, at most: compiled kernels weigh so many in one step."""

CELLS_TOGETHER = 4
"""Neighbouring cells of a view that share one t, or none do: compiled kernels have code for so many."""

ASIDE = 0.1
"""Detector rows by which a ray may leave its height where cells share one t."""


@dataclass(frozen=True)
class ConeLines:
    """Strips of some views that are steep in the volume, or after a quarter turn of it.

    Args:
        strips: The strips seen along the axis; `measured` numbers views and bins.
        view: For each cell the number of its view.
        part: For each cell the part t of the way from focal spot to cell at the middle row, the mean of its group.
        change: Its change from row to row.
        nearness: One over the distance from focal spot to cell seen along the axis, 1/mm.
        group: For each group of cells that share t the number of the first, and after all the number of cells.
    """

    strips: RayLines
    view: NDArray[np.int32]
    part: Array
    change: Array
    nearness: Array
    group: NDArray[np.int64]


@dataclass(frozen=True)
class ViewHeights:
    """Where the detector rows of each view are, in slices from the lower face of the volume.

    Args:
        low: Height of the focal spot.
        rise: Lower edge of the lowest row, above the focal spot.
        step: Height of a row.
        cells: Middle of each row above the focal spot, mm: (views, rows).
    """

    low: NDArray[np.float64]
    rise: NDArray[np.float64]
    step: float
    cells: Array


def cone_lines(grid: VolumeGrid, geometry: ConeBeam, together: int = 1) -> list[ConeLines]:
    """Tabulate the strips of all views: those that are steep in a slice, and those that are after a quarter turn.

    Args:
        grid: Where the voxels are.
        geometry: Where the rays are.
        together: Neighbouring cells that share one t.
    """
    fan = seen_along_the_axis(geometry)
    spots, cells = fan.focal_spots()[:, None], fan.detector_points(fan.fan_angles)
    distance = np.linalg.norm(cells - spots, axis=-1)
    tables = []
    for strips in frame_lines(grid.plane, fan, "distance-driven"):
        turn = strips.turns[0]
        # Up, in the turned image: y, or after a quarter turn −x.
        axis, sign = (1, 1.0) if turn == 0 else (0, -1.0)
        view, cell = np.divmod(strips.measured[:, 0], fan.bins)
        spot, center = sign * spots[view, 0, axis], sign * grid.plane.center[axis]
        way = sign * cells[view, cell, axis] - spot
        group = _groups(view, cell, together)

        def shared(values: NDArray[np.float64], group: NDArray[np.int64] = group) -> Array:
            sizes = np.diff(group)
            return np.repeat(np.add.reduceat(values, group[:-1]) / sizes, sizes).astype(np.float32)

        tables.append(
            ConeLines(
                strips=strips,
                view=view.astype(np.int32),
                part=shared((center - spot) / way),
                change=shared(-grid.plane.spacing / way),
                nearness=(1 / distance[view, cell]).astype(np.float32),
                group=group,
            )
        )
    return tables


def view_heights(grid: VolumeGrid, geometry: ConeBeam) -> ViewHeights:
    """Tabulate where the rows of each view are."""
    bottom = grid.heights[0] - grid.slice_spacing / 2
    spots = geometry.focal_spots()[:, 2]
    above = geometry.trajectory.heights - spots
    return ViewHeights(
        low=(spots - bottom) / grid.slice_spacing,
        rise=(above + geometry.detector.row_edges[0]) / grid.slice_spacing,
        step=geometry.detector.row_height / grid.slice_spacing,
        cells=(above[:, None] + geometry.detector.row_positions).astype(np.float32),
    )


def _groups(view: NDArray[np.int32], cell: NDArray[np.int32], most: int) -> NDArray[np.int64]:
    """Return where groups of at most so many cells begin, neighbours in one view, and the number of all cells."""
    numbers = np.arange(len(view))
    apart = np.diff(view, prepend=-1) != 0
    apart |= np.diff(cell, prepend=-1) != 1
    runs = np.maximum.accumulate(np.where(apart, numbers, 0))
    return np.append(np.flatnonzero((numbers - runs) % most == 0), len(view))


def _highest(geometry: ConeBeam) -> float:
    """Return the detector rows between the plane of the focal spot and the farthest edge of a row, at most."""
    spots = geometry.focal_spots()
    heights = geometry.trajectory.heights[:, None] - spots[:, 2:] + geometry.detector.row_edges[[0, -1]]
    return float(np.abs(heights).max()) / geometry.detector.row_height


def cells_together(geometry: ConeBeam) -> int:
    """Return how many neighbouring cells share one t: `CELLS_TOGETHER`, or 1 if rays would leave their heights."""
    # A ray is 45 degrees from the direction in which it crosses rows, at most.
    change = math.sqrt(2) * geometry.detector.bin_width / geometry.source_to_detector
    return CELLS_TOGETHER if (CELLS_TOGETHER - 1) / 2 * change * _highest(geometry) <= ASIDE else 1


def rows_together(grid: VolumeGrid, geometry: ConeBeam) -> int:
    """Return how many rows of the image share one t: so many that no ray leaves its height by more than `BENT` rows."""
    spots = geometry.focal_spots()
    nearest = float(np.linalg.norm(spots[:, :2], axis=1).min()) - min(grid.plane.radius, geometry.field_of_view_radius)
    # A ray is 45 degrees from the direction in which it crosses rows, at most.
    bend = _highest(geometry) * math.sqrt(2) * grid.plane.spacing / nearest
    together = MOST_TOGETHER
    while together > 1 and (together - 1) / 2 * bend > BENT:
        together //= 2
    return together


def check_volume(grid: VolumeGrid, geometry: ConeBeam) -> None:
    """Check that rays meet the volume, that the focal spot is outside it, and that detector rows have a height.

    Raises:
        ValueError: If not.
    """
    detector = geometry.detector
    if not detector.row_height:
        raise ValueError(
            "A cone beam's projector needs the height of the detector rows, got a fan without thickness; give "
            "Detector(row_height=...), or project slices as a fan beam."
        )
    check_reach(grid.plane, seen_along_the_axis(geometry))
    reach = (geometry.source_to_isocenter + geometry.field_of_view_radius) / geometry.source_to_detector
    spots, middles = geometry.focal_spots()[:, 2], geometry.trajectory.heights
    low, high = ((spots + reach * (middles + edge - spots)) for edge in detector.row_edges[[0, -1]])
    low, high = min(low.min(), spots.min()), max(high.max(), spots.max())
    half = grid.slices * grid.slice_spacing / 2
    if grid.z - half >= high or grid.z + half <= low:
        raise ValueError(
            f"No ray meets the volume: the beam goes from z = {low:.1f} to {high:.1f} mm, the volume from "
            f"{grid.z - half:.1f} to {grid.z + half:.1f} mm."
        )


def seen_along_the_axis(geometry: ConeBeam) -> FanBeam:
    """Return the fan beam that all detector rows share."""
    shifts = [(along, away, 0.0) for along, away, _ in geometry.trajectory.focal_spot_shifts]
    return FanBeam.from_cone_beam(replace(geometry, trajectory=Trajectory(geometry.trajectory.angles, (), shifts)))
