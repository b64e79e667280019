"""The mathematics of rays: the only place where a fan beam meets an image grid.

Seen in the frame in which it is steep, a detector cell casts on each row of the image a strip between two columns
that change linearly from row to row. Those lines are all that the kernels know: an arc, a flat detector, an offset, a
moving focal spot are tables of lines.

Turning the image by quarter turns makes every ray steep, and makes view β + 90° of the image view β of the turned
image. Four views then share one table of lines, one *lane* for each turn.
"""

import math
from collections import defaultdict
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pnpct.geometry import FanBeam, ImageGrid

Method = Literal["distance-driven", "joseph"]
"""What a ray takes of the pixels of a row: the mean over its width, or the value between the two nearest."""

SAME_ANGLE = 2e-6
"""Views closer than this to a quarter turn apart, rad, share their lines: 0.5 µm at 250 mm from the isocentre."""

WIDEST_STRIP = 2.0
"""A strip wider than this on a row, in columns, is cut into narrower ones, so that three taps always cover it."""

TAPS = 3
"""Columns next to one another that a strip can have something of on a row."""

LEFT, RIGHT = 1, 3
"""Columns of zeros beside the image; strips that begin outside are moved there."""

NARROWEST = 1e-6
"""Columns. Behind the focal spot, always beside the image, the lines of a strip cross and its width is negative."""


@dataclass(frozen=True)
class RayLines:
    """Strips that are steep in the turned images, as lines over the rows.

    On row r of H rows a strip begins at column `edge + slope (r − (H−1)/2)` and is `width + widening (r − (H−1)/2)`
    columns wide; column c covers [c, c + 1]. Its value is `length` times the mean of the row under the strip, summed
    over the rows.

    Args:
        turns: The quarter turns, clockwise, of the image in each lane.
        rows: Rows of the turned image.
        cols: Columns of the turned image.
        edge: Left edge at the middle row.
        slope: Change of the left edge from row to row.
        width: Width at the middle row.
        widening: Change of the width from row to row.
        length: Path per row, mm, as a part of the strip's cell.
        measured: For each cell and lane the number of its ray (view · bins + bin), or −1 for none.
        parts: Strips per cell, which follow one another in the table.
        pencil: For each cell the number of its pencil: rays of one view that run to the same side of the rows. The left
            edges of their strips meet in one point.
        apex: For each pencil that point, column and rows below the middle, and 1 if the rays run downwards, −1 if up.
    """

    turns: tuple[int, ...]
    rows: int
    cols: int
    edge: NDArray[np.float32]
    slope: NDArray[np.float32]
    width: NDArray[np.float32]
    widening: NDArray[np.float32]
    length: NDArray[np.float32]
    measured: NDArray[np.int32]
    parts: int
    pencil: NDArray[np.int32]
    apex: NDArray[np.float32]

    @property
    def strips(self) -> int:
        """Number of strips."""
        return self.edge.size


def ray_lines(grid: ImageGrid, geometry: FanBeam, method: Method) -> list[RayLines]:
    """Tabulate the strips of all rays, with four lanes where the views allow it, else one frame after the other.

    The image must be within reach of the rays (`check_reach`).
    """
    orbits = view_orbits(geometry)
    if turns_onto_itself(grid) and geometry.views >= 2 * len(orbits):
        return [_four_lanes(grid, geometry, orbits, method)]
    return frame_lines(grid, geometry, method)


def frame_lines(grid: ImageGrid, geometry: FanBeam, method: Method) -> list[RayLines]:
    """Tabulate all strips in one lane: those that are steep in the image, and those that are after a quarter turn."""
    return [lines for turn in (0, 1) if (lines := _one_lane(grid, geometry, turn, method)).strips]


def turned_shape(grid: ImageGrid, turns: tuple[int, ...]) -> tuple[int, int]:
    """Return rows and columns of the image after the quarter turns, padded to a square if there are several."""
    if len(turns) > 1:
        return max(grid.shape), max(grid.shape)
    return grid.shape if turns[0] % 2 == 0 else (grid.cols, grid.rows)


def check_reach(grid: ImageGrid, geometry: FanBeam) -> None:
    """Check that rays meet the image, and that the focal spot is outside it.

    Raises:
        ValueError: If not.
    """
    nearest = float(np.linalg.norm(geometry.focal_spots(), axis=1).min())
    if grid.radius >= nearest:
        raise ValueError(
            f"The image must lie inside the circle of the focal spot: its farthest corner is {grid.radius:.1f} mm from "
            f"the isocentre, the focal spot {nearest:.1f} mm; use a smaller image or check the units of the distances."
        )
    half = (grid.cols * grid.spacing / 2, grid.rows * grid.spacing / 2)
    gap = math.hypot(*(max(abs(middle) - side, 0.0) for middle, side in zip(grid.center, half, strict=True)))
    if gap >= geometry.field_of_view_radius:
        raise ValueError(
            f"No ray meets the image: the field of view has a radius of {geometry.field_of_view_radius:.1f} mm and the "
            f"image begins {gap:.1f} mm from the isocentre."
        )


def turns_onto_itself(grid: ImageGrid) -> bool:
    """Whether quarter turns map pixels to pixels, at no more than twice the memory when padded to a square."""
    sides = sorted(grid.shape)
    return grid.center == (0.0, 0.0) and (sides[1] - sides[0]) % 2 == 0 and sides[1] <= 2 * sides[0]


def view_orbits(geometry: FanBeam) -> list[tuple[float, dict[int, int]]]:
    """Group views a whole number of quarter turns apart: (angle below 90°, quarter turn -> view)."""
    quarter = math.pi / 2
    shifts = geometry.focal_spot_shifts or ((0.0, 0.0),) * geometry.views
    groups: dict[tuple[float, float], list[tuple[float, int, int]]] = defaultdict(list)
    for view, beta in enumerate(geometry.view_angles):
        turn = math.floor((beta + SAME_ANGLE) / quarter)
        groups[shifts[view]].append((beta - turn * quarter, turn % 4, view))
    orbits: list[tuple[float, dict[int, int]]] = []
    for members in groups.values():
        members.sort()
        open_from = len(orbits)
        for rest, turn, view in members:
            while open_from < len(orbits) and rest - orbits[open_from][0] > SAME_ANGLE:
                open_from += 1
            for _, views in orbits[open_from:]:
                if turn not in views:
                    views[turn] = view
                    break
            else:
                orbits.append((rest, {turn: view}))
    return orbits


def _four_lanes(
    grid: ImageGrid, geometry: FanBeam, orbits: list[tuple[float, dict[int, int]]], method: Method
) -> RayLines:
    shifts = geometry.focal_spot_shifts
    first = replace(
        geometry,
        view_angles=tuple(angle for angle, _ in orbits),
        focal_spot_shifts=tuple(shifts[next(iter(views.values()))] for _, views in orbits) if shifts else (),
    )
    view_at = np.array([[views.get(turn, -1) for turn in range(4)] for _, views in orbits], np.int64)
    along = _directions(first, first.fan_angles)
    flat = _is_flat(along)
    # Lane q holds the image turned q times; a flat ray is steep after one turn more, and so belongs to the view before.
    turn = (np.arange(4) - flat[..., None]) % 4
    view = np.take_along_axis(view_at[:, None, :], turn, axis=2)
    ray = np.where(view >= 0, view * geometry.bins + np.arange(geometry.bins)[:, None], -1)
    side = max(grid.shape)
    square = replace(grid, rows=side, cols=side)
    keep = np.ones_like(flat, bool)
    return _tabulate(square, first, along, flat, keep, ray, (0, 1, 2, 3), method)


def _one_lane(grid: ImageGrid, geometry: FanBeam, turn: int, method: Method) -> RayLines:
    along = _directions(geometry, geometry.fan_angles)
    flat = _is_flat(along)
    ray = np.arange(flat.size).reshape(*flat.shape, 1)
    return _tabulate(grid, geometry, along, np.full_like(flat, turn), flat == turn, ray, (turn,), method)


def _directions(geometry: FanBeam, angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """From the focal spot to the detector at the fan angles: (views, angles, 2), mm."""
    return geometry.detector_points(angles) - geometry.focal_spots()[:, None]


def _is_flat(along: NDArray[np.float64]) -> NDArray[np.int64]:
    """1 where a ray runs more along x than along y, else 0: the turns that make it steep."""
    return (np.abs(along[..., 0]) > np.abs(along[..., 1])).astype(np.int64)


def _tabulate(
    grid: ImageGrid,
    geometry: FanBeam,
    along: NDArray[np.float64],
    turn: NDArray[np.int64],
    keep: NDArray[np.bool_],
    ray: NDArray[np.int64],
    turns: tuple[int, ...],
    method: Method,
) -> RayLines:
    """Tabulate the rays to keep, which run `along`, each seen in the image after `turn` quarter turns."""
    rows, cols = turned_shape(grid, turns)
    edges = _directions(geometry, geometry.fan_angle_edges)
    at, slopes = zip(
        *(_line(grid, geometry, each, turn, cols) for each in (edges[:, :-1], along, edges[:, 1:])), strict=True
    )
    length = grid.spacing * np.sqrt(1 + slopes[1] ** 2)
    down = np.where(_turned(along, turn)[1] < 0, 1, -1)
    if method == "joseph":
        # Interpolation between two pixel centres is the mean under a strip one column wide.
        edge, slope = at[1] - 0.5, slopes[1]
        width, widening = np.ones_like(edge), np.zeros_like(edge)
    else:
        left = slopes[0] * down <= slopes[2] * down  # where the rays run; in a wide fan the middle row may be behind
        edge, slope = np.where(left, at[0], at[2]), np.where(left, slopes[0], slopes[2])
        width, widening = (np.where(left, 1, -1) * (ends[2] - ends[0]) for ends in (at, slopes))
    widest = (width[keep] + np.abs(widening[keep]) * (rows - 1) / 2).max(initial=0.0)
    parts = max(1, math.ceil(widest / WIDEST_STRIP))

    pencil, apex = _pencils(grid, geometry, turn, down, keep, cols)
    if method == "joseph":
        apex[:, 0] -= 0.5

    def strips(values: NDArray[np.float64]) -> NDArray[np.float32]:
        return np.repeat(values[keep], parts).astype(np.float32)

    part = np.tile(np.arange(parts), int(keep.sum())) / parts
    return RayLines(
        turns=turns,
        rows=rows,
        cols=cols,
        edge=(np.repeat(edge[keep], parts) + part * np.repeat(width[keep], parts)).astype(np.float32),
        slope=(np.repeat(slope[keep], parts) + part * np.repeat(widening[keep], parts)).astype(np.float32),
        width=strips(width / parts),
        widening=strips(widening / parts),
        length=strips(length / parts),
        measured=np.ascontiguousarray(ray[keep], np.int32),
        parts=parts,
        pencil=pencil,
        apex=apex.astype(np.float32),
    )


def _line(
    grid: ImageGrid, geometry: FanBeam, along: NDArray[np.float64], turn: NDArray[np.int64], cols: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return column at the middle row and columns per row, of the rays that run `along`, in the turned image."""
    x, y = _turned((geometry.focal_spots() - grid.center)[:, None], turn)
    across, up = _turned(along, turn)
    with np.errstate(divide="ignore", invalid="ignore"):  # flat rays, which the caller leaves out
        per_y = across / up
        x_at_middle = x - y * per_y
    return x_at_middle / grid.spacing + cols / 2, -per_y


def _pencils(
    grid: ImageGrid,
    geometry: FanBeam,
    turn: NDArray[np.int64],
    down: NDArray[np.int64],
    keep: NDArray[np.bool_],
    cols: int,
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Return `pencil` and `apex` of the rays to keep."""
    name = (np.arange(geometry.views)[:, None] * 2 + turn % 2) * 2 + (down > 0)
    names, pencil = np.unique(name[keep], return_inverse=True)
    spot = (geometry.focal_spots()[names // 4] - grid.center) / grid.spacing
    x, y = _turned(spot, names // 2 % 2)
    apex = np.stack([x + cols / 2, -y, np.where(names % 2, 1.0, -1.0)], axis=1)
    return pencil.astype(np.int32), apex


def _turned(point: NDArray[np.float64], turn: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return x and y of points after `turn` clockwise quarter turns, 0 or 1."""
    x, y = point[..., 0], point[..., 1]
    return np.where(turn % 2, y, x), np.where(turn % 2, -x, y)
