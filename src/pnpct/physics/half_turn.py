"""Whether both halves of a turn show the same object: a check of where the detector is."""

import math

import numpy as np
import scipy
from numpy.typing import NDArray

from pnpct.geometry import ConeBeam
from pnpct.physics.scan import Scan

_WINDOW = math.radians(15)
_WIDEST = math.radians(6)
_SHIFTS = np.arange(-4.0, 4.01, 0.25)
_DISTINCT = 0.8
"""Largest ratio of the least to the greatest misfit at which the least one says something."""


def half_turn_views(geometry: ConeBeam) -> tuple[slice, slice] | None:
    """Return views in the middle of a scan, and those half a turn later that see the same rays the other way.

    Only rays within 6 degrees of the central one are compared, so that few views need to be read.

    Args:
        geometry: Where the rays are; consecutive views at even angles.

    Returns:
        Both; None if the scan is too short.
    """
    angles = np.asarray(geometry.trajectory.angles)
    if len(angles) < 3 or angles[-1] == angles[0]:
        return None
    step = abs(angles[-1] - angles[0]) / (len(angles) - 1)
    window, around = max(2, round(_WINDOW / step)), math.ceil(2 * _WIDEST / step) + 1
    half = round(math.pi / step)
    first = (len(angles) - half - window) // 2
    if first < around or first + half + window + around > len(angles):
        return None
    return slice(first, first + window), slice(first + half - around, first + half + window + around)


def column_shift(scan: Scan, opposite: Scan) -> float | None:
    """Return by how many columns the detector has to be shifted for both halves of a turn to show the same edges.

    The ray at the view angle β and the fan angle γ is seen again, in the other direction, at β + π + 2γ and −γ; where
    the focal spot rises, by the rows that meet it near the axis. If γ is wrong by a shift of the detector, the edges of
    both do not fit. The shift is where the mean square difference is least: 0 within a quarter of a column if all is
    well. It needs no reference. Tilted focal spots are taken at their mean; mirrored scans agree as well.

    Args:
        scan: Views, from `half_turn_views`.
        opposite: Those half a turn later.

    Returns:
        Columns towards growing fan angle, within −4 to 4; None if the data do not tell.

    Raises:
        ValueError: If these are no scans with detector rows, without a batch.
    """
    geometry, other = scan.geometry, opposite.geometry
    if not (isinstance(geometry, ConeBeam) and isinstance(other, ConeBeam) and scan.counts.ndim == 3):
        raise ValueError(f"Scans with detector rows are needed, without a batch, got {geometry}.")
    near, far = _line_integrals(scan), _line_integrals(opposite)
    misfits = np.array([_misfit(geometry, other, near, far, shift) for shift in _SHIFTS])
    known = np.flatnonzero(np.isfinite(misfits))
    if not known.size or not np.nanmin(misfits) < _DISTINCT * np.nanmax(misfits):
        return None
    least = int(np.nanargmin(misfits))
    if not 0 < least < len(_SHIFTS) - 1 or not np.isfinite(misfits[least - 1 : least + 2]).all():
        return None
    before, at, after = misfits[least - 1 : least + 2]
    return float(_SHIFTS[least] + 0.125 * (before - after) / (before - 2 * at + after))


def _line_integrals(scan: Scan) -> NDArray[np.float64]:
    """Line integrals (views, rows, bins), smoothed over three bins, which takes noise at the steps of the grid away."""
    counts = scan.counts.clamp_min(0.5)
    values = (scan.incident / counts).log().double().numpy()
    return np.asarray(scipy.ndimage.uniform_filter1d(values, 3, axis=-1, mode="nearest"))


def _misfit(
    geometry: ConeBeam, opposite: ConeBeam, near: NDArray[np.float64], far: NDArray[np.float64], shift: float
) -> float:
    """Mean square difference between rays and their opposites if the detector is shifted by so many columns."""
    detector, distance = geometry.detector, geometry.source_to_detector
    step = 2 * math.atan(detector.bin_width / 2 / distance)
    nominal = geometry.fan_angles
    bins = np.flatnonzero(np.abs(nominal) < _WIDEST - 4 * step)
    # A focal spot beside the nominal one moves the ray at the axis like a turn of the fan.
    beside = _mean_shift(geometry) * (1 / geometry.source_to_isocenter - 1 / distance)
    gamma = nominal[bins] + shift * step + beside
    column = (-gamma - beside - nominal[0]) / step - shift
    beta, betas = np.asarray(geometry.trajectory.angles), np.asarray(opposite.trajectory.angles)
    direction = math.copysign(1.0, betas[-1] - betas[0])
    wanted = beta[:, None] + direction * math.pi + 2 * gamma
    view = (wanted - betas[0]) * (len(betas) - 1) / (betas[-1] - betas[0])
    heights = np.interp(view, np.arange(len(betas)), opposite.trajectory.heights)
    climb = (heights - geometry.trajectory.heights[:, None]) / 2
    rise = climb * distance / (geometry.source_to_isocenter * np.cos(gamma))
    rows = [(side * rise - detector.row_positions[0]) / max(detector.row_height, 1e-9) for side in (1, -1)]
    if detector.rows == 1:
        rows = [np.zeros_like(rise)] * 2
    inside = (view >= 0) & (view <= len(betas) - 1) & (column >= 0) & (column <= detector.bins - 1)
    inside &= np.all([(row >= 0) & (row <= detector.rows - 1) for row in rows], axis=0)
    if not inside.any():
        return math.nan
    own = np.broadcast_to(np.arange(len(beta))[:, None], view.shape)
    here = scipy.ndimage.map_coordinates(
        near, [part[inside] for part in (own, rows[0], np.broadcast_to(bins, view.shape))], order=1
    )
    there = np.broadcast_to(column, view.shape)
    seen = scipy.ndimage.map_coordinates(far, [part[inside] for part in (view, rows[1], there)], order=1)
    return float(np.mean((here - seen) ** 2))


def _mean_shift(geometry: ConeBeam) -> float:
    """Mean shift of the focal spot along the fan, mm."""
    shifts = geometry.trajectory.focal_spot_shifts
    return float(np.mean([along for along, _, _ in shifts])) if shifts else 0.0
