"""Numbers that a scan or an image can have, and the mistake that is likely behind others.

The ranges are wide: from scanners of small samples to those of pallets. What lies outside may still be meant, so that
whoever insists is let through.
"""

import math

import numpy as np

from pnpct.arrays import Image, Volume
from pnpct.files.errors import FileFormatError, PathLike
from pnpct.geometry import FanBeam, ImageGrid
from pnpct.physics import Scan
from pnpct.units import to_hu

DISTANCES_MM = (1.0, 20_000.0)
"""From the focal spot to the isocentre and to the detector."""

BIN_WIDTHS_MM = (1e-3, 100.0)

FOCAL_SPOT_SHIFT_MM = 50.0
"""Flying focal spots move by a few mm."""

MU_WATER = (0.006, 0.1)
"""From 1.3 MeV down to 18 keV, 1/mm."""

MOST_TURNS = 3.0
"""Of a scan in one plane: two turns are sometimes averaged."""

LEAST_SPAN = math.radians(7.0)
"""Of a scan of ten views and more: a turn in rad that was taken for degrees has 6.3."""

_THICKEST = 0.05
"""Share of the rays that may be behind more, such as metal."""

_CELLS = 32
"""Fewer do not see a body."""

BRIGHTER, SHARE = 3.0, 0.05
"""Times the incident counts, which no more than this share of the rays exceed by noise."""

FLAT_HU, LARGEST_HU, TISSUE_HU = 20.0, 35_000.0, 500.0
"""An image has a wider range than ± the first and no larger values than the second; where it has more than the last,
it has air or fat below zero too."""

MOST_HU = 1e6
"""Beyond any matter: values above are those of a damaged file, or have a wrong slope."""

SIDES_MM = (1.0, 10_000.0)
"""Of an image that another program has written."""

LIKE_WATER, _PIXELS = (0.6, 1.35), 1 << 18
"""The median of an object of soft tissue, relative to water, is within; so many pixels are enough to tell."""

DENSEST = 4.0
"""Of a body that fills what the fan sees, relative to water: aluminium has 3.4."""


def check_foreign_image(path: PathLike, low: float, high: float, plane: ImageGrid, *, own: bool = False) -> None:
    """Check that an image of a file can be one in HU, with pixels in mm.

    Args:
        path: The file.
        low: The lowest value.
        high: The highest value.
        plane: Where the pixels are.
        own: Whether pnpct has written it, so that its unit is known.

    Raises:
        FileFormatError: If values or lengths are of another unit.
    """
    if not own and -FLAT_HU <= low <= high <= FLAT_HU:
        raise FileFormatError(
            f"{path}: HU were needed, where air is -1000, but the values go from {low:g} to {high:g}; are they in "
            "another unit, such as 0 to 1?"
        )
    if not -MOST_HU <= low <= high <= MOST_HU:
        raise FileFormatError(f"{path}: values from {low:g} to {high:g} are no HU; is the file damaged?")
    side = max(plane.shape) * plane.spacing
    if not own and not SIDES_MM[0] <= side <= SIDES_MM[1]:
        unit = "m" if side < SIDES_MM[0] else "µm"
        raise FileFormatError(
            f"{path}: an image of {side:.3g} mm, where {SIDES_MM[0]:g} to {SIDES_MM[1]:g} mm are usual: are the "
            f"distances of its pixels in {unit}? They must be in mm."
        )


def doubt_of(scan: Scan) -> str:
    """Return what is hardest to believe of a scan of one plane, with the likely mistake; empty if all is usual."""
    of_geometry = _doubt_of_geometry(scan.geometry) if isinstance(scan.geometry, FanBeam) else ""
    if of_geometry:
        return of_geometry
    if not MU_WATER[0] <= scan.mu_water <= MU_WATER[1]:
        return f"mu_water = {scan.mu_water:g}/mm, where {MU_WATER[0]:g} to {MU_WATER[1]:g}/mm are usual: is it in 1/cm?"
    bright = (scan.counts > BRIGHTER * scan.incident) & scan.measured
    if (share := float(bright.double().mean())) > SHARE:
        return (
            f"counts above {BRIGHTER:g} times the incident counts in {share:.0%} of its rays: are these of another "
            "exposure, or have the line integrals the wrong sign?"
        )
    return _doubt_of_density(scan) if isinstance(scan.geometry, FanBeam) else ""


def _doubt_of_density(scan: Scan) -> str:
    """Find lengths and attenuations whose units do not fit: line integrals that no body of this size has."""
    incident = scan.incident.expand(scan.counts.shape[-2:])
    counted = (scan.counts > 0) & scan.measured
    if scan.geometry.bins < _CELLS or not bool(counted.any()):
        return ""
    transmissions = (scan.counts / incident)[counted].cpu().numpy()
    most = -math.log(float(np.quantile(transmissions, _THICKEST)))
    size = 2 * scan.geometry.field_of_view_radius
    density = most / (scan.mu_water * size)
    if density <= DENSEST:
        return ""
    return (
        f"line integrals up to {most:.3g}, which {size:.3g} mm, all that the fan sees, have where they are filled with "
        f"{density:.2g} times the attenuation of water: are the lengths in cm, or is mu_water of another energy?"
    )


def _doubt_of_geometry(geometry: FanBeam) -> str:
    for length, (least, most) in (
        (geometry.source_to_isocenter, DISTANCES_MM),
        (geometry.source_to_detector, DISTANCES_MM),
        (geometry.bin_width, BIN_WIDTHS_MM),
    ):
        if not least <= length <= most:
            unit = "m" if length < least else "µm or nm"
            return f"a length of {length:g} mm, where {least:g} to {most:g} mm are usual: is it in {unit}?"
    shift = max((abs(length) for shift in geometry.focal_spot_shifts for length in shift), default=0.0)
    if shift > FOCAL_SPOT_SHIFT_MM:
        return f"a focal spot shifted by {shift:g} mm, where {FOCAL_SPOT_SHIFT_MM:g} mm are much: is it in µm?"
    span = float(np.ptp(geometry.view_angles))
    if span > MOST_TURNS * 2 * math.pi:
        return f"view angles over {span / 2 / math.pi:.3g} turns: are they degrees, to be given as view_angles_deg?"
    if geometry.views >= 10 and span < LEAST_SPAN:
        return f"view angles over {math.degrees(span):.3g} degrees: are they rad, to be given as view_angles_rad?"
    return ""


def doubt_of_object(image: Image) -> str:
    """Return what is unusual in the attenuation of an object, relative to water, with what may be wrong; else nothing.

    The object is what exceeds 0.3 of the largest values; its median is that of soft tissue in all patients. Wood, foam
    and aluminium are other than water too, so this says no more than that; and nothing of images of few pixels.
    """
    if min(image.shape[-2:]) < _CELLS:
        return ""
    values = image.detach().flatten()[:: max(1, image.numel() // _PIXELS)].double()
    inside = values[values > 0.3 * values.quantile(0.995)]
    median = float(inside.median()) if inside.numel() else 0.0
    if not 0 < median < math.inf or LIKE_WATER[0] <= median <= LIKE_WATER[1]:
        return ""
    return (
        f"an object of {median:.2g} times the attenuation of water (the median). If it is near water: line integrals "
        "are natural logarithms, those to the base 10 times 2.303; lengths are in mm; and --mu-water is in 1/mm, at "
        "the energy of the scan."
    )


def doubt_of_image(image: Image | Volume) -> str:
    """Return what is hard to believe of an image, relative to water, with the likely mistake; empty if all is usual."""
    low, high = float(to_hu(image).min()), float(to_hu(image).max())
    values = f"values from {low:.5g} to {high:.5g} HU"
    if -FLAT_HU <= low <= high <= FLAT_HU:
        return (
            f"{values}, where air has -1000 and bone more than 300: are they of another unit, such as 1/cm or 0 to 1?"
        )
    if max(-low, high) > LARGEST_HU:
        return (
            f"{values}, where metal has 30,000 at most: are they HU that were taken for attenuation relative to water?"
        )
    if low >= -FLAT_HU and high > TISSUE_HU:
        return f"{values}, but none of air or fat: are they stored values, without the intercept of -1024?"
    return ""
