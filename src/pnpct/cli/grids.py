"""The grid of the image."""

import math
from pathlib import Path

from pnpct.files import read_truth
from pnpct.geometry import Geometry, ImageGrid, require_fan_beam, require_image_grid

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
    scan: Path, geometry: Geometry, *, size: int | None, field_of_view: float | None, insist: bool = False
) -> ImageGrid:
    """Return the grid for a reconstruction.

    What is not given is that of the truth in the scan, if there is one; otherwise the grid has 512 rows and columns
    over the field of view of the fan.

    Args:
        scan: File of the scan.
        geometry: Its geometry.
        size: Rows and columns.
        field_of_view: Side of the square, mm.
        insist: Whether a field of view is taken that looks like a mistake of units.

    Raises:
        OSError: If the scan cannot be read.
        ValueError: If a number is out of range, or the truth in the scan is incomplete.
    """
    known = read_truth(scan)
    usual = require_image_grid(known[1]) if known else require_fan_beam(geometry).grid()
    if size is None and field_of_view is None:
        return usual
    if field_of_view is not None and not insist:
        _check_usual(field_of_view, 2 * require_fan_beam(geometry).field_of_view_radius)
    return square_grid(
        usual.cols if size is None else size,
        usual.cols * usual.spacing if field_of_view is None else field_of_view,
        center=usual.center,
    )


def _check_usual(field_of_view: float, seen: float) -> None:
    """Find the field of view that was given in another unit than mm."""
    if 0 < field_of_view < seen / _MOST_TIMES or seen * _MOST_TIMES < field_of_view < float("inf"):
        unit = "cm or m" if field_of_view < seen else "µm"
        raise ValueError(
            f"The field of view is {field_of_view:g} mm, where the fan sees {seen:.4g} mm: is it in {unit}? If it is "
            "meant, insist on it (--insist)."
        )
