"""Filtered back-projection of a fan beam, for any set of views."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import torch
from numpy.typing import NDArray

from pnpct.arrays import Image, Rays
from pnpct.geometry import FanBeam, ImageGrid
from pnpct.operators import FanBackprojector, Kernel, Projector, ramp_filter
from pnpct.reconstruction.moving_spot import FanAtRest, fans_at_rest
from pnpct.reconstruction.redundancy import ray_weights


def fbp(line_integrals: Rays, projector: Projector, *, kernel: Kernel = "ram-lak") -> Image:
    """Reconstruct by filtered back-projection.

    Each ray is weighted by cos γ and by the angle it represents (`ray_weights`); the views are convolved with the ramp
    of their detector and back-projected over L². Statistical weights are not used. Autograd works through it, any
    number of times, for networks that contain it.

        image = 1/mu_water Σ_β R^e / L² (h ∗ [weight · R cos γ · y])     e = 0 on an arc, 1 and D on a flat detector

    Args:
        line_integrals: Measured line integrals; a full rotation, a short scan, or any set of views. Lines that were not
            measured are taken from the nearest views. Where the focal spot moves, each view is interpolated to even
            angles about its own (`moving_spot`).
        projector: The rays, the pixels, and the attenuation of water.
        kernel: "ram-lak", "shepp-logan", "hann" or "soft", from sharp to smooth.

    Returns:
        Image relative to water.

    Raises:
        ValueError: If the kernel is unknown, or the fan opens beyond 45 degrees on a side.

    References:
        Kak and Slaney (2001), sections 3.4.1 and 3.4.2.
    """
    fans = _prepare(projector.grid, projector.geometry)
    first, *others = [fan(line_integrals, kernel, projector.mu_water) for fan in fans]
    return sum(others, start=first)


@dataclass(frozen=True, eq=False)
class _Prepared:
    """What FBP needs to know of a fan beam at rest: weights of the rays, empty bins to add, spacing, and the scale."""

    views: FanAtRest
    weight: Rays
    padding: tuple[int, int]
    spacing: float
    scale: float
    back_project: FanBackprojector

    def __call__(self, line_integrals: Rays, kernel: Kernel, mu_water: float) -> Image:
        weighted = self.views.rays(line_integrals) * self.weight.to(line_integrals)
        filtered = ramp_filter(
            torch.nn.functional.pad(weighted, self.padding) if any(self.padding) else weighted,
            spacing=self.spacing,
            equiangular=self.views.fan.detector == "arc",
            kernel=kernel,
        )
        return self.back_project(filtered) * (self.scale / mu_water)


@lru_cache(maxsize=32)
def _prepare(grid: ImageGrid, geometry: FanBeam) -> list[_Prepared]:
    """Prepare each fan beam at rest; the planes of a volume have 16 geometries."""
    fans = fans_at_rest(geometry)
    weight = np.empty(geometry.shape)
    # The angle that a ray represents is half-way to its neighbours among all views, wherever their focal spots are.
    order = np.concatenate([fan.views for fan in fans])
    angles = np.concatenate([fan.fan.view_angles for fan in fans])
    weight[order] = ray_weights(replace(geometry, view_angles=angles, focal_spot_shifts=()))
    return [_prepare_fan(grid, fan, weight[fan.views]) for fan in fans]


def _prepare_fan(grid: ImageGrid, views: FanAtRest, weight: NDArray[np.float64]) -> _Prepared:
    geometry = views.fan
    distance, arc = geometry.source_to_isocenter, geometry.detector == "arc"
    wide, padding = _with_both_sides(geometry)
    # On a flat detector the bins are taken at the isocentre, where lengths are those of the image.
    spacing = float(np.diff(geometry.fan_angle_edges[:2])[0]) if arc else geometry.bin_width_at_isocenter
    return _Prepared(
        views=views,
        weight=torch.from_numpy(weight * np.cos(geometry.fan_angles) * distance).float(),
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
