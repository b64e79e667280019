"""Weighted back-projection of filtered views of a cone beam: the last step of FDK, and not the projector's adjoint."""

from collections.abc import Iterator
from dataclasses import replace
from typing import final

import numpy as np
import torch
from torch import Tensor
from typing_extensions import override

from pnpct.arrays import ConeRays, Volume
from pnpct.geometry import ConeBeam, VolumeGrid
from pnpct.operators.cone import back_kernels as kernels
from pnpct.operators.cone.border_kernels import unpack_volume
from pnpct.operators.cone.cone_kernels import WIDTH
from pnpct.operators.cone.cone_lines import check_volume, seen_along_the_axis
from pnpct.operators.fan_backprojector import FanBackprojector
from pnpct.operators.fan_kernels import BLOCK
from pnpct.operators.gradients import linear
from pnpct.operators.lane_kernels import Array
from pnpct.operators.linear_operator import LinearOperator
from pnpct.operators.threads import parallel

TOGETHER = 1 << 22
"""Rays of the views that are in the order of the kernels at a time, at most."""


@final
class ConeBackprojector(LinearOperator):
    """Sum over the views the value interpolated between two bins and two rows at each voxel, over its squared distance.

        volume(x) = Σ_views  q(view, row(x), bin(x)) / L(x)²

    L is the distance from the focal spot seen along the axis, on a flat detector its part along the central ray. Voxels
    above or below all rows take the outermost one. It is differentiable, any number of times; its adjoint runs in plain
    torch operations, on a CPU many times as long.

    Args:
        grid: Where the voxels are.
        geometry: Where the rays are.

    Raises:
        ValueError: If the focal spot moves in the plane, the fan opens beyond 45 degrees on a side, no ray meets the
            volume, or the detector rows have no height.

    References:
        Feldkamp, Davis and Kress, J. Opt. Soc. Am. A 1 (1984) 612.
    """

    def __init__(self, grid: VolumeGrid, geometry: ConeBeam) -> None:
        check_volume(grid, geometry)
        fan = seen_along_the_axis(geometry)
        at_rest = not np.any(fan.focal_spot_shifts)
        self._fan = FanBackprojector(grid.plane, replace(fan, focal_spot_shifts=()) if at_rest else fan)
        self.grid, self.geometry = grid, geometry
        self.domain_shape, self.range_shape = geometry.shape, grid.shape
        # In detector rows from the middle of the lowest one a voxel of slice k is at start + (low + k step)/L.
        spots, detector = geometry.focal_spots()[:, 2], geometry.detector
        per_row = geometry.source_to_detector / detector.row_height
        self._start = (spots - geometry.trajectory.heights - detector.row_positions[0]) / detector.row_height
        self._low, self._step = (grid.heights[0] - spots) * per_row, grid.slice_spacing * per_row

    @override
    def forward(self, x: ConeRays) -> Volume:
        """Return the sum over the views; 1/mm² times the unit of the rays."""
        return linear(x, self._sum, self.adjoint)

    @override
    def adjoint(self, y: Volume) -> ConeRays:
        """Return the transpose of that sum, which is not a projection."""
        return linear(y, self._spread, self.forward)

    def _sum(self, rays: Tensor) -> Tensor:
        volumes = rays.new_empty((*rays.shape[:-3], *self.grid.shape))
        apply = self._on_cpu if rays.device.type == "cpu" else self._anywhere
        for source, target in zip(
            rays.reshape(-1, *self.domain_shape), volumes.view(-1, *self.range_shape), strict=True
        ):
            target.copy_(apply(source.float()))
        return volumes

    def _on_cpu(self, rays: Tensor) -> Tensor:
        views, rows, bins = self.geometry.shape
        slices, height, width = self.grid.shape
        single, plane = np.float32, self.grid.plane
        image = np.zeros((height, width, -(-slices // WIDTH) * WIDTH), single)
        place = (single(plane.x[0]), single(plane.y[0]), single(plane.spacing))
        scale, offset = self._fan.bins
        of_bins = (np.int64(bins), single(scale), single(offset))
        angles = np.asarray(self.geometry.trajectory.angles)
        of_views: list[Array] = [array.astype(single) for array in (np.cos(angles), np.sin(angles))]
        heights: list[Array] = [array.astype(single) for array in (self._start, self._low)]
        distance, arc = single(self.geometry.source_to_isocenter), self.geometry.detector.kind == "arc"
        step = max(1, TOGETHER // (rows * bins))
        for first in range(0, views, step):
            part = slice(first, min(first + step, views))
            measured = rays[part].contiguous().numpy()
            packed = np.empty((len(measured), bins + 3, rows), single)
            parallel(kernels.pack_views, len(measured), measured, packed)
            (cosines, sines), (start, low) = ([array[part] for array in arrays] for arrays in (of_views, heights))
            rows_of_views = (start, low, single(self._step))
            arguments = (image, packed, cosines, sines, rows_of_views, place, distance, of_bins, arc)
            parallel(kernels.back_project_cone, height, *arguments, multiple=BLOCK)
        volume = np.empty(self.grid.shape, single)
        parallel(unpack_volume, height, image, 0, volume)
        return torch.from_numpy(volume)

    def _anywhere(self, rays: Tensor) -> Tensor:
        """Do the same by torch operations, a view at a time."""
        volume = rays.new_zeros(self.grid.shape)
        for view, (bin_, share, row, height, weight) in zip(rays, self._places(rays.device), strict=True):
            padded = torch.nn.functional.pad(view, (1, 1))
            below, above = (
                torch.lerp(padded[number, bin_], padded[number, bin_ + 1], share)
                for number in (row, (row + 1).clamp(max=self.geometry.rows - 1))
            )
            volume += torch.lerp(below, above, height) * weight
        return volume

    def _spread(self, volumes: Tensor) -> Tensor:
        rays = volumes.new_empty((*volumes.shape[:-3], *self.geometry.shape))
        for source, target in zip(
            volumes.reshape(-1, *self.range_shape), rays.view(-1, *self.domain_shape), strict=True
        ):
            target.copy_(self._spread_one(source.float()))
        return rays

    def _spread_one(self, volume: Tensor) -> Tensor:
        views, rows, bins = self.geometry.shape
        padded = volume.new_zeros(views, rows * (bins + 2))
        for view, (bin_, share, row, height, weight) in zip(padded, self._places(volume.device), strict=True):
            for number, of_row in ((row, 1 - height), ((row + 1).clamp(max=rows - 1), height)):
                for other, of_bin in ((bin_, 1 - share), (bin_ + 1, share)):
                    values = volume * weight * of_row * of_bin
                    view.index_add_(0, (number * (bins + 2) + other).flatten(), values.flatten())
        return padded.view(views, rows, bins + 2)[..., 1:-1]

    def _places(self, device: torch.device) -> Iterator[tuple[Tensor, Tensor, Tensor, Tensor, Tensor]]:
        """Yield what each view gives to each voxel.

        That is, of each pixel the lower bin among padded ones and the share of the upper one, of each voxel the lower
        row and the share of the upper one, and of each pixel 1/L².
        """
        k = torch.arange(self.grid.slices, device=device)[:, None, None]
        for start, low, (lower, share, weight) in zip(self._start, self._low, self._fan.places(device), strict=True):
            height = (float(start) + (float(low) + k * float(self._step)) * weight.sqrt()).clamp(
                0, self.geometry.rows - 1
            )
            row = height.floor()
            yield lower, share, row.long(), height - row, weight
