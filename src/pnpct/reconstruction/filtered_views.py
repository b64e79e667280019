"""Weighting and filtering of the views of a fan beam: the first two steps of filtered back-projection."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from pnpct.arrays import Rays
from pnpct.geometry import FanBeam
from pnpct.geometry.short_repr import short_repr
from pnpct.operators import Kernel, ramp_filter
from pnpct.reconstruction.moving_spot import FanAtRest, fans_at_rest
from pnpct.reconstruction.redundancy import ray_weights


@dataclass(frozen=True, eq=False)
class FilteredViews:
    """From the line integrals of all views to the filtered rays of those whose focal spot has one distance.

    Args:
        views: These views, with their focal spot at rest.
        fan: The rays after filtering: those of the views, and bins beside the shorter side of the detector.
        weight: Of each ray before it is filtered, mm rad.
        padding: Bins added before the first and after the last.
        spacing: Of the bins, rad on an arc, mm at the axis on a flat detector.
        scale: Of the back-projection.
    """

    views: FanAtRest
    fan: FanBeam
    weight: Rays
    padding: tuple[int, int]
    spacing: float
    scale: float

    __repr__ = short_repr

    def __call__(self, line_integrals: Rays, kernel: Kernel) -> Tensor:
        """Return the filtered rays, in the shape of `fan`."""
        weighted = self.views.rays(line_integrals) * self.weight.to(line_integrals)
        return ramp_filter(
            torch.nn.functional.pad(weighted, self.padding) if any(self.padding) else weighted,
            spacing=self.spacing,
            equiangular=self.fan.detector == "arc",
            kernel=kernel,
        )


@lru_cache(maxsize=32)
def filtered_views(geometry: FanBeam) -> list[FilteredViews]:
    """Prepare the views of each fan beam at rest; the planes of a volume have 16 geometries."""
    fans = fans_at_rest(geometry)
    weight = np.empty(geometry.shape)
    # The angle that a ray represents is half-way to its neighbours among all views, wherever their focal spots are.
    order = np.concatenate([fan.views for fan in fans])
    angles = np.concatenate([fan.fan.view_angles for fan in fans])
    weight[order] = ray_weights(replace(geometry, view_angles=angles, focal_spot_shifts=()))
    return [_of_fan(fan, weight[fan.views]) for fan in fans]


def _of_fan(views: FanAtRest, weight: NDArray[np.float64]) -> FilteredViews:
    geometry = views.fan
    distance, arc = geometry.source_to_isocenter, geometry.detector == "arc"
    wide, padding = _with_both_sides(geometry)
    # On a flat detector the bins are taken at the isocentre, where lengths are those of the image.
    spacing = float(np.diff(geometry.fan_angle_edges[:2])[0]) if arc else geometry.bin_width_at_isocenter
    return FilteredViews(
        views=views,
        fan=wide,
        weight=torch.from_numpy(weight * np.cos(geometry.fan_angles) * distance).float(),
        padding=padding,
        spacing=spacing,
        scale=1.0 if arc else distance,
    )


def _with_both_sides(geometry: FanBeam) -> tuple[FanBeam, tuple[int, int]]:
    """Add empty bins to the shorter side of the fan: a truncated view has filtered values beyond its end."""
    low, high = -geometry.fan_angle_edges[0], geometry.fan_angle_edges[-1]
    missing = round(abs(low - high) / (low + high) * geometry.bins)
    if missing <= 1:  # a quarter-detector offset
        return geometry, (0, 0)
    before, after = (missing, 0) if low < high else (0, missing)
    return geometry.widened(before, after), (before, after)
