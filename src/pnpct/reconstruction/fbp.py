"""Filtered back-projection of a fan beam, for any set of views."""

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import torch
from numpy.typing import NDArray

from pnpct.arrays import Image, Rays
from pnpct.geometry import FanBeam, ImageGrid
from pnpct.operators import FanBackprojector, Kernel, Projector, ramp_filter

GAP = 1.5
"""Views farther apart than this many times the usual step have a gap between them."""


def fbp(line_integrals: Rays, projector: Projector, *, kernel: Kernel = "ram-lak") -> Image:
    """Reconstruct by filtered back-projection.

    Each ray is weighted by its share of the line it measures, by cos γ and by the angle its view stands for; the
    views are convolved with the ramp of their detector and back-projected over L². Statistical weights are not used.

        image = 1/mu_water Σ_β Δβ R^e / L² (h ∗ [share · R cos γ · y])     e = 0 on an arc, 1 and D on a flat detector

    Args:
        line_integrals: Measured line integrals; a full turn, a short scan, or any set of views. Lines that were not
            measured are missing from the image.
        projector: Says where the rays and the pixels are, and what water attenuates.
        kernel: "ram-lak", "shepp-logan", "hann" or "soft", from sharp to smooth.

    Returns:
        Image relative to water.

    Raises:
        ValueError: If the kernel is unknown, the focal spot moves, or the fan opens beyond 45 degrees on a side.

    References:
        Kak and Slaney (2001), sections 3.4.1 and 3.4.2; Parker, Med. Phys. 9 (1982) 254.
    """
    prepared = _prepare(projector.grid, projector.geometry)
    weighted = line_integrals * prepared.weight.to(line_integrals)
    filtered = ramp_filter(
        torch.nn.functional.pad(weighted, prepared.padding) if any(prepared.padding) else weighted,
        spacing=prepared.spacing,
        equiangular=projector.geometry.detector == "arc",
        kernel=kernel,
    )
    return prepared.back_project(filtered) * (prepared.scale / projector.mu_water)


@dataclass(frozen=True, eq=False)
class _Prepared:
    """What FBP needs to know of a geometry: weights of the rays, empty bins to add, spacing, and the scale."""

    weight: Rays
    padding: tuple[int, int]
    spacing: float
    scale: float
    back_project: FanBackprojector


@lru_cache(maxsize=4)
def _prepare(grid: ImageGrid, geometry: FanBeam) -> _Prepared:
    distance, arc = geometry.source_to_isocenter, geometry.detector == "arc"
    wide, padding = _with_both_sides(geometry)
    weight = measured_share(geometry) * np.cos(geometry.fan_angles) * view_steps(geometry)[:, None] * distance
    # On a flat detector the bins are taken at the isocentre, where lengths are those of the image.
    spacing = float(np.diff(geometry.fan_angle_edges[:2])[0]) if arc else geometry.bin_width_at_isocenter
    return _Prepared(
        weight=torch.from_numpy(weight).float(),
        padding=padding,
        spacing=spacing,
        scale=1.0 if arc else distance,
        back_project=FanBackprojector(grid, wide),
    )


def _with_both_sides(geometry: FanBeam) -> tuple[FanBeam, tuple[int, int]]:
    """Add empty bins to the shorter side of the fan: a truncated view has filtered values beyond its end."""
    low, high = -geometry.fan_angle_edges[0], geometry.fan_angle_edges[-1]
    missing = round(abs(low - high) / (low + high) * geometry.bins)
    if missing <= 1:  # a quarter-detector offset
        return geometry, (0, 0)
    before, after = (missing, 0) if low < high else (0, missing)
    if geometry.detector == "arc":
        pitch = geometry.fan_angle_edges[1] - geometry.fan_angle_edges[0]
        middle = (geometry.fan_angle_edges[0] + geometry.fan_angle_edges[-1] + (after - before) * pitch) / 2
        offset = math.tan(middle) * geometry.source_to_detector / geometry.bin_width
    else:
        offset = geometry.detector_offset + (after - before) / 2
    wide = replace(geometry, bins=geometry.bins + missing, detector_offset=offset)
    return wide, (before, after)


def view_steps(geometry: FanBeam) -> NDArray[np.float64]:
    """Return the angle that each view stands for, rad: half-way to its neighbours, and half a step into a gap."""
    order, steps, usual = _sorted_steps(geometry)
    half = np.where(steps > GAP * usual, usual, steps) / 2
    result = np.empty(geometry.views)
    result[order] = half + np.roll(half, 1)
    return result


def measured_share(geometry: FanBeam) -> NDArray[np.float64]:
    """Return for each ray its share of the line it measures; the shares of the rays on one line add up to 1.

    The ray (β, γ) and the ray (β + π + 2γ, −γ) are the same line. With q the distance of a ray from the end of the
    measured views times its distance from the end of the detector, and q′ that of the other ray,

        share = sin²(π/2 · q / (q + q′))

    It is 1/2 over a full turn, Parker's weights in a short scan, and Wang's on a detector that is moved far aside;
    where there are gaps it passes smoothly from one to the other.

    References:
        Parker, Med. Phys. 9 (1982) 254; Wang, Med. Phys. 29 (2002) 1634.
    """
    beta = np.asarray(geometry.view_angles)[:, None]
    gamma = geometry.fan_angles
    here = _depth_in_views(geometry, beta + 0 * gamma) * _depth_in_fan(geometry, gamma)
    there = _depth_in_views(geometry, beta + math.pi + 2 * gamma) * _depth_in_fan(geometry, -gamma)
    both = here + there
    part = np.divide(here, both, out=np.ones_like(both), where=both > 0)
    share: NDArray[np.float64] = np.sin(math.pi / 2 * part) ** 2
    return share


def _sorted_steps(geometry: FanBeam) -> tuple[NDArray[np.int64], NDArray[np.float64], float]:
    """Return the order of the views, the step from each to the next around the circle, and the usual step."""
    turn = 2 * math.pi
    # Angles a rounding error below a full turn belong to its beginning.
    angles = np.mod(np.asarray(geometry.view_angles) + 1e-9, turn)
    order = np.argsort(angles, kind="stable")
    steps = np.diff(angles[order], append=angles[order[0]] + turn)
    apart = steps[steps > 1e-6]
    return order, steps, min(float(np.median(apart)), math.radians(10.0))


def _depth_in_views(geometry: FanBeam, angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how far inside the measured views an angle is, rad: 0 in a gap, 1 for a full turn."""
    turn = 2 * math.pi
    order, steps, usual = _sorted_steps(geometry)
    sorted_angles = np.mod(np.asarray(geometry.view_angles) + 1e-9, turn)[order]
    after = np.flatnonzero(steps > GAP * usual)
    if after.size == 0:
        return np.ones_like(angles)
    ends = sorted_angles[after] + usual / 2
    starts = sorted_angles[(after + 1) % len(order)] - usual / 2
    # Each piece of measured views runs from a start to the next end, both counted upwards from the angle.
    to_end = np.mod(ends - angles[..., None], turn).min(-1)
    from_start = np.mod(angles[..., None] - starts, turn).min(-1)
    length = np.mod(ends[:, None] - starts, turn).min(0)  # of the piece after each start
    nearest = np.mod(angles[..., None] - starts, turn).argmin(-1)
    depth: NDArray[np.float64] = np.where(from_start <= length[nearest], np.minimum(from_start, to_end), 0.0)
    return depth


def _depth_in_fan(geometry: FanBeam, fan_angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how far inside the detector a fan angle is, rad; 0 beside it."""
    low, high = geometry.fan_angle_edges[[0, -1]]
    depth: NDArray[np.float64] = np.maximum(np.minimum(fan_angles - low, high - fan_angles), 0.0)
    return depth
