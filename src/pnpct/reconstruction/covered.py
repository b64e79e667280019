"""Which slices a scan with several detector rows covers, and the planes that they are interpolated from."""

import math
from dataclasses import replace

from pnpct.geometry import ImageGrid, TiltedPlanes, VolumeGrid

_FINEST = 100
"""Most planes for the height of a detector row: those of a window are in memory together."""


def covered_slices(planes: TiltedPlanes, plane: ImageGrid, thickness: float = 0.0) -> tuple[float, float]:
    """Return the lowest and the highest slice that can be reconstructed over the whole of a grid, mm.

    Args:
        planes: The views.
        plane: Pixels of a slice.
        thickness: Of a slice, mm.

    Raises:
        ValueError: If there is none, or the thickness is out of range.
    """
    if not (math.isfinite(thickness) and thickness >= 0):
        raise ValueError(f"The thickness of slices is a length in mm from 0 up, got {thickness}.")
    low, high = planes.reach
    less = margin_of(planes, plane) + thickness / 2
    if low + less > high - less:
        raise ValueError(
            f"No slice of {thickness:g} mm is covered over the whole field of view: planes go from {low:.4g} to "
            f"{high:.4g} mm on the axis; use a smaller field of view or a longer scan."
        )
    return low + less, high - less


def check_covered(planes: TiltedPlanes, grid: VolumeGrid, thickness: float) -> None:
    """Check that all slices of a volume can be reconstructed.

    Raises:
        ValueError: If one cannot.
    """
    low, high = covered_slices(planes, grid.plane, thickness)
    lowest, highest = grid.heights[[0, -1]]
    if lowest < low - 1e-3 or highest > high + 1e-3:
        raise ValueError(
            f"The scan covers slices from {low:.4g} to {high:.4g} mm, but the volume goes from {lowest:.4g} to "
            f"{highest:.4g} mm; ask for fewer slices."
        )


def plane_distance(planes: TiltedPlanes, grid: VolumeGrid, thickness: float, largest: float | None = None) -> float:
    """Return the distance between the planes that are reconstructed, mm; of a circle such that thin slices are planes.

    Args:
        planes: The views.
        grid: The slices.
        thickness: Of a slice, mm.
        largest: The `plane_spacing` of `reconstruct_volume`.

    Raises:
        ValueError: If that is out of range.
    """
    row = planes.geometry.row_height_at_isocenter or grid.slice_spacing
    if largest is not None and not (math.isfinite(largest) and largest > 0):
        raise ValueError(f"The distance between planes must be a positive length in mm, got {largest}.")
    if largest is not None and largest < row / _FINEST:
        raise ValueError(
            f"The distance between planes must be at least {row / _FINEST:.2g} mm, a hundredth of a detector row, got "
            f"{largest:g}; planes nearer than half a row hardly differ."
        )
    spacing = (row if thickness >= 2 * row else row / 2) if largest is None else largest
    if planes.feed == 0 and thickness == 0:
        return grid.slice_spacing / equal_parts(grid.slice_spacing, max(row, spacing))
    return spacing


def equal_parts(length: float, longest: float) -> int:
    """Return into how many equal parts, at least 1, a length is cut so that none is longer than `longest`.

    A scanner's 0.625 mm are 0.62498 mm by its geometry: parts may be a hundredth longer.
    """
    return max(1, math.ceil(length / longest - 0.01))


def planes_of_a_row(planes: TiltedPlanes, distance: float) -> int:
    """Return how many planes of a distance, mm, are as far apart as the slices of two detector rows; at least 1."""
    return max(1, round((planes.geometry.row_height_at_isocenter or distance) / distance))


def covered_grid(
    planes: TiltedPlanes,
    plane: ImageGrid,
    *,
    thickness: float = 0.0,
    slices: int | None = None,
    slice_spacing: float | None = None,
    z: float | None = None,
    known: VolumeGrid | None = None,
) -> VolumeGrid:
    """Return slices to reconstruct: as many as the scan covers, a detector row apart, where nothing else is given.

    Args:
        planes: The views.
        plane: Pixels of a slice.
        thickness: Of a slice, mm.
        slices: Their number.
        slice_spacing: Distance between their middles, mm; that of the known slices if None.
        z: Height of the middle of all, mm.
        known: Slices of a truth: those of them that the scan covers, if neither number, distance nor height is given.

    Raises:
        ValueError: If a number is out of range, or the scan covers no slice.
    """
    low, high = covered_slices(planes, plane, thickness)
    if known is not None and (slices, z, slice_spacing) == (None, None, None):
        covered = [float(height) for height in known.heights if low <= height <= high]
        if covered:
            return VolumeGrid(plane, len(covered), known.slice_spacing, (covered[0] + covered[-1]) / 2)
    if slice_spacing is None:
        slice_spacing = known.slice_spacing if known else planes.geometry.row_height_at_isocenter or high - low or 1.0
    middle = (low + high) / 2 if z is None else z
    one = VolumeGrid(plane, 1, slice_spacing, middle)  # which checks the spacing
    half = max(0.0, min(middle - low, high - middle))
    return replace(one, slices=1 + math.floor(2 * half / slice_spacing + 1e-6) if slices is None else slices)


def margin_of(planes: TiltedPlanes, plane: ImageGrid) -> float:
    """How far a tilted plane leaves its height on the axis, within the field of view, mm."""
    return abs(planes.tilt) * min(plane.radius, planes.geometry.field_of_view_radius)
