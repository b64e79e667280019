"""Filtered back-projection of a fan beam, for any set of views."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import torch

from pnpct.arrays import Image, Rays
from pnpct.geometry import FanBeam, ImageGrid
from pnpct.operators import FanBackprojector, Kernel, Projector, ramp_filter
from pnpct.reconstruction.redundancy import ray_weights


def fbp(line_integrals: Rays, projector: Projector, *, kernel: Kernel = "ram-lak") -> Image:
    """Reconstruct by filtered back-projection.

    Each ray is weighted by cos γ and by the angle it represents (`ray_weights`); the views are convolved with the ramp
    of their detector and back-projected over L². Statistical weights are not used.

        image = 1/mu_water Σ_β R^e / L² (h ∗ [weight · R cos γ · y])     e = 0 on an arc, 1 and D on a flat detector

    Args:
        line_integrals: Measured line integrals; a full rotation, a short scan, or any set of views. Lines that were not
            measured are taken from the nearest views.
        projector: The rays, the pixels, and the attenuation of water.
        kernel: "ram-lak", "shepp-logan", "hann" or "soft", from sharp to smooth.

    Returns:
        Image relative to water.

    Raises:
        ValueError: If the kernel is unknown, the focal spot moves, or the fan opens beyond 45 degrees on a side.

    References:
        Kak and Slaney (2001), sections 3.4.1 and 3.4.2.
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
    weight = ray_weights(geometry) * np.cos(geometry.fan_angles) * distance
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
    return geometry.widened(before, after), (before, after)
