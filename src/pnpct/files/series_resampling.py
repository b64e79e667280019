"""Series of CT images onto the planes and heights of a volume, by linear interpolation."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pnpct.files.image_series import AIR_HU, ImageSeries
from pnpct.geometry import ImageGrid


def without_tilt(series: ImageSeries, rise: float) -> ImageSeries:
    """Return axial images of a series that a tilted gantry took.

    Each new image has the height of the middle of an old one. What of it lies before the first or after the last of
    the old images was not imaged, and is air.

    Args:
        series: Its images lie askew: `z` are the heights of their middles, the plane is that of their own pixels,
            around the point that is their middle.
        rise: Height that the images gain per mm in their own plane, from the front to the back: the sine of the tilt.

    Returns:
        The series, float32; its notes say what was done.

    Raises:
        ValueError: If there is a single image.
    """
    if len(series.z) == 1:
        raise ValueError("A single image of a tilted gantry cannot be made axial; give the whole series.")
    plane, level = series.plane, math.sqrt(1 - rise**2)
    z, last = np.asarray(series.z), plane.rows - 1
    rows = int(last * level) + 1
    image_hu = np.empty((len(z), rows, plane.cols), np.float32)
    for row in range(rows):
        # Rows of the old images between which the new one lies, where they are seen along the axis.
        at = last / 2 + (row - (rows - 1) / 2) / level
        before = min(int(at), last)
        after = min(before + 1, last)
        values = _between(series.image_hu[:, before], series.image_hu[:, after], at - before)
        image_hu[:, row] = _at_heights(values, z, z - (at - last / 2) * plane.spacing * rise)
    degrees = math.degrees(math.asin(abs(rise)))
    note = (
        f"The gantry was tilted by {degrees:.1f} degrees: the images were resampled to axial planes, in which what was "
        "not imaged is air."
    )
    axial = ImageGrid(rows, plane.cols, plane.spacing, plane.center)
    return replace(series, image_hu=image_hu, plane=axial, notes=(*series.notes, note))


def evenly_spaced(series: ImageSeries) -> ImageSeries:
    """Return a series whose slices are at the same distance from each other: the median distance of the given ones.

    Slices that are within a tenth of that distance of even heights already stay as they are.

    Returns:
        The series; if it was resampled, float32, and its notes say so.
    """
    if series.is_even:
        return series
    z = np.asarray(series.z)
    steps = np.diff(z)
    usual = float(np.median(steps))
    heights = z[0] + usual * np.arange(int((z[-1] - z[0]) / usual + 1e-6) + 1)
    image_hu = _at_heights(series.image_hu, z, heights)
    note = (
        f"The slices are {steps.min():g} to {steps.max():g} mm apart: they were resampled to even distances of "
        f"{usual:g} mm."
    )
    return replace(series, image_hu=image_hu, z=tuple(heights.tolist()), notes=(*series.notes, note))


def _at_heights(
    values: NDArray[np.generic], z: NDArray[np.float64], heights: NDArray[np.float64]
) -> NDArray[np.float32]:
    """Interpolate along the first axis, from the heights z to others; outside there is air."""
    above = np.clip(np.searchsorted(z, heights), 1, len(z) - 1)
    share = (heights - z[above - 1]) / (z[above] - z[above - 1])
    result = _between(values[above - 1], values[above], share.reshape(-1, *[1] * (values.ndim - 1)).astype(np.float32))
    tolerance = 1e-6 * (z[1] - z[0])
    result[(heights < z[0] - tolerance) | (heights > z[-1] + tolerance)] = AIR_HU
    return result


def _between(
    first: NDArray[np.generic], second: NDArray[np.generic], share: NDArray[np.float32] | float
) -> NDArray[np.float32]:
    low = first.astype(np.float32)
    return low + share * (second.astype(np.float32) - low)
