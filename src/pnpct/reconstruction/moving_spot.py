"""A moving focal spot, for what takes one at rest: each view as a fan about its own focal spot.

A view from a focal spot at another place is one of a fan at rest: at the angle at which the focal spot is seen from the
axis, and at its distance. About it the cells of the detector have uneven fan angles; along the bins the view is
interpolated to the even ones. Views with the focal spot at one distance are one fan beam.
"""

from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from pnpct.arrays import Rays
from pnpct.geometry import FanBeam

_IN_MICROMETRES = 3
"""Distances that agree to as many decimals of a millimetre are one."""


@dataclass(frozen=True, eq=False)
class FanAtRest:
    """Views of a fan beam as those of one whose focal spot is at rest.

    Args:
        views: Their numbers.
        fan: Where their rays are then.
        bins: For each view and fan angle the place among the measured bins: (views, bins); None where nothing moves.
    """

    views: NDArray[np.int64]
    fan: FanBeam
    bins: NDArray[np.float64] | None = None

    def rays(self, values: Rays) -> Tensor:
        """Return the values of these views at the fan angles of the fan."""
        if self.bins is None:
            return values
        lower = torch.from_numpy(np.floor(self.bins).astype(np.int64)).to(values.device)
        share = torch.from_numpy(self.bins).to(values) - lower
        chosen = values[..., torch.from_numpy(self.views).to(values.device), :]
        upper = (lower + 1).clamp(max=values.shape[-1] - 1)
        return torch.lerp(_of_bins(chosen, lower), _of_bins(chosen, upper), share)


def fans_at_rest(geometry: FanBeam) -> list[FanAtRest]:
    """Return the views by the distance of the focal spot from the axis, each as a fan beam with that distance."""
    numbers = np.arange(geometry.views)
    if not geometry.focal_spot_shifts:
        return [FanAtRest(numbers, geometry)]
    spots = geometry.focal_spots()
    angles = np.arctan2(-spots[:, 0], spots[:, 1])
    distances = np.hypot(spots[:, 0], spots[:, 1]).round(_IN_MICROMETRES)
    along = geometry.detector_points(geometry.fan_angles) - spots[:, None]
    turned = np.arctan2(along[..., 0], -along[..., 1]) - angles[:, None]
    fan_angles = np.mod(turned + np.pi, 2 * np.pi) - np.pi
    even, cells = geometry.fan_angles, np.arange(geometry.bins)
    bins = np.stack([np.interp(even, of_view, cells) for of_view in fan_angles])
    fans = []
    for distance in np.unique(distances):
        views = numbers[distances == distance]
        fan = replace(geometry, view_angles=angles[views], source_to_isocenter=float(distance), focal_spot_shifts=())
        fans.append(FanAtRest(views, fan, bins[views]))
    return fans


def _of_bins(values: Tensor, number: Tensor) -> Tensor:
    return torch.gather(values, -1, number.expand(*values.shape[:-2], *number.shape))
