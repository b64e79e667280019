"""The grid of the image."""

import math
from pathlib import Path

from pnpct.files import read_truth
from pnpct.geometry import Geometry, Grid, ImageGrid, VolumeGrid, require_fan_beam, require_image_grid

_MOST_TIMES = 25
"""How many times smaller or larger than what the fan sees an image is at most, where nobody insists."""


def square_grid(size: int, field_of_view: float, *, center: tuple[float, float] = (0.0, 0.0)) -> ImageGrid:
    """Return a square grid.

    Args:
        size: Rows and columns, at least 1.
        field_of_view: Side of the square, mm, > 0.
        center: Its centre, mm.

    Raises:
        ValueError: If a number is out of range.
    """
    if size < 1:
        raise ValueError(f"The size of an image must be at least one pixel, got {size}.")
    if not (math.isfinite(field_of_view) and field_of_view > 0):
        raise ValueError(f"The field of view must be a positive length in mm, got {field_of_view}.")
    return ImageGrid(size, size, field_of_view / size, center)


def grid_for(
    scan: Path,
    geometry: Geometry,
    *,
    size: int | None,
    field_of_view: float | None,
    center: tuple[float, ...] | None = None,
    insist: bool = False,
) -> ImageGrid:
    """Return the grid for a reconstruction of one plane.

    What is not given is that of the truth in the scan, if there is one; otherwise the grid has 512 rows and columns
    over the field of view of the fan.

    Args:
        scan: File of the scan.
        geometry: Its geometry.
        size: Rows and columns.
        field_of_view: Side of the square, mm.
        center: Its centre, mm.
        insist: Whether a field of view is taken that looks like a mistake of units.

    Raises:
        OSError: If the scan cannot be read.
        ValueError: If a number is out of range, or the truth in the scan is incomplete.
    """
    if center is not None and len(center) != 2:
        raise ValueError(f"--center is x and y in mm for a scan of one plane, got {len(center)} numbers.")
    known = read_truth(scan)
    geometry, truth = require_fan_beam(geometry), require_image_grid(known[1]) if known else None
    return plane_for(truth, geometry, size=size, field_of_view=field_of_view, center=center, insist=insist)


def plane_for(
    truth: Grid | None,
    geometry: Geometry,
    *,
    size: int | None,
    field_of_view: float | None,
    center: tuple[float, ...] | None,
    insist: bool = False,
) -> ImageGrid:
    """Return the pixels of a slice, as `grid_for` does.

    Args:
        truth: Grid of the truth in the scan, if there is one.
        geometry: Geometry of the scan.
        size: Rows and columns.
        field_of_view: Side of the square, mm.
        center: Its centre x and y, mm; what follows them is not looked at.
        insist: Whether a field of view is taken that looks like a mistake of units.

    Raises:
        ValueError: If a number is out of range.
    """
    usual = truth.plane if isinstance(truth, VolumeGrid) else truth or geometry.grid()
    if size is None and field_of_view is None and center is None:
        return usual
    if center is not None and not 2 <= len(center) <= 3:
        raise ValueError(f"--center is x and y in mm, and z for a volume, got {len(center)} numbers.")
    if field_of_view is not None and not insist:
        _check_usual(field_of_view, 2 * geometry.field_of_view_radius)
    return square_grid(
        usual.cols if size is None else size,
        usual.cols * usual.spacing if field_of_view is None else field_of_view,
        center=usual.center if center is None else (center[0], center[1]),
    )


def _check_usual(field_of_view: float, seen: float) -> None:
    """Find the field of view that was given in another unit than mm."""
    if 0 < field_of_view < seen / _MOST_TIMES or seen * _MOST_TIMES < field_of_view < float("inf"):
        unit = "cm or m" if field_of_view < seen else "µm"
        raise ValueError(
            f"The field of view is {field_of_view:g} mm, where the fan sees {seen:.4g} mm: is it in {unit}? If it is "
            "meant, insist on it (--insist)."
        )
