"""Weighted back-projection of filtered fan-beam views: the last step of FBP. It is not the projector's adjoint."""

from collections.abc import Iterator
from typing import final

import numpy as np
import torch
from torch import Tensor
from typing_extensions import override

from pnpct.arrays import Image, Rays
from pnpct.geometry import FanBeam, ImageGrid
from pnpct.operators import lane_kernels as lanes
from pnpct.operators.fan_kernels import BLOCK, back_project_fan
from pnpct.operators.gradients import linear
from pnpct.operators.kernels import triton_runs_on
from pnpct.operators.lane_kernels import Array
from pnpct.operators.linear_operator import LinearOperator
from pnpct.operators.ray_lines import turns_onto_itself, view_orbits
from pnpct.operators.threads import parallel
from pnpct.operators.tiles import tile

WIDEST_FAN = np.pi / 4


@final
class FanBackprojector(LinearOperator):
    """Sum over the views the value interpolated between two bins at each pixel, over its squared distance.

        image(x) = Σ_views  q(view, bin(x)) / L(x)²

    L is the distance from the focal spot on an arc, and its part along the central ray on a flat detector. It is
    differentiable, any number of times; its adjoint runs in plain torch operations, on a CPU twenty times as long.

    Args:
        grid: Where the pixels are.
        geometry: Where the rays are.

    Raises:
        ValueError: If the focal spot moves in the views, or the fan opens beyond 45 degrees on a side.

    References:
        Kak and Slaney, Principles of Computerized Tomographic Imaging (2001), sections 3.4.1 and 3.4.2.
    """

    def __init__(self, grid: ImageGrid, geometry: FanBeam) -> None:
        if geometry.focal_spot_shifts:
            raise ValueError(
                "Fan-beam back-projection takes a focal spot that stays in place, got one shift per view; take the "
                "views with one distance of the focal spot at a time, as fbp does."
            )
        widest = np.abs(geometry.fan_angle_edges).max()
        if widest > WIDEST_FAN:
            raise ValueError(
                f"Filtered back-projection takes fans of at most 45 degrees on a side, got {np.degrees(widest):.1f}."
            )
        self.grid, self.geometry = grid, geometry
        self.domain_shape, self.range_shape = geometry.shape, grid.shape
        orbits = view_orbits(geometry)
        if turns_onto_itself(grid) and geometry.views >= 2 * len(orbits):
            self._turns: tuple[int, ...] = (0, 1, 2, 3)
            self._shape = (max(grid.shape), max(grid.shape))
            views = np.array([[members.get(turn, -1) for turn in range(4)] for _, members in orbits], np.int64)
        else:
            self._turns, self._shape = (0,), grid.shape
            views = np.arange(geometry.views)[:, None]
            orbits = [(angle, {}) for angle in geometry.view_angles]
        self._angles = np.array([angle for angle, _ in orbits])
        # One bin of zeros on either side: beside the detector nothing was measured.
        ray = np.where(views[:, None] >= 0, views[:, None] * geometry.bins + np.arange(geometry.bins)[:, None], -1)
        self._measured = np.ascontiguousarray(
            np.pad(ray, ((0, 0), (1, 1), (0, 0)), constant_values=-1).reshape(-1, len(self._turns)), np.int32
        )

    @override
    def forward(self, x: Rays) -> Image:
        """Return the sum over the views; 1/mm² times the unit of the rays."""
        return linear(x, self._sum, self.adjoint)

    @override
    def adjoint(self, y: Image) -> Rays:
        """Return the transpose of that sum, which is not a projection."""
        return linear(y, self._spread, self.forward)

    def _sum(self, rays: Tensor) -> Tensor:
        flat = rays.reshape(-1, *self.geometry.shape).float().contiguous()
        if flat.device.type == "cpu":
            images = torch.from_numpy(self._on_cpu(flat.numpy().reshape(len(flat), -1)))
        elif triton_runs_on(flat.device):
            from pnpct.operators.triton_backprojector import back_project_fan

            images = back_project_fan(flat, self.grid, self.geometry, self.bins)
        else:
            images = self._anywhere(flat)
        return images.reshape(*rays.shape[:-2], *self.grid.shape).to(rays.dtype)

    @property
    def bins(self) -> tuple[float, float]:
        """Scale and offset from γ (arc) or tan γ (flat) to the bin."""
        geometry = self.geometry
        if geometry.detector == "arc":
            scale = 1 / (geometry.fan_angle_edges[1] - geometry.fan_angle_edges[0])
            return scale, -geometry.fan_angles[0] * scale
        return geometry.source_to_detector / geometry.bin_width, (geometry.bins - 1) / 2 - geometry.detector_offset

    def _on_cpu(self, rays: Array) -> Array:
        height, width = self._shape
        size, slices = tile(rays.shape[0], len(self._turns))
        image = lanes.aligned((-(-height // BLOCK) * BLOCK, width, size))
        views = lanes.aligned((len(self._measured) + 1, size))  # what is beside the last bin has a neighbour too
        images = np.empty((rays.shape[0], *self.grid.shape), np.float32)
        single = np.float32
        spacing, (x, y) = self.grid.spacing, self.grid.center
        place = (
            single(x - (width - 1) / 2 * spacing),
            single(y + (height - 1) / 2 * spacing),
            single(spacing),
        )
        scale, offset = self.bins
        bins = (np.int64(self.geometry.bins), single(scale), single(offset))
        cosines, sines = np.cos(self._angles).astype(single), np.sin(self._angles).astype(single)
        distance, arc = single(self.geometry.source_to_isocenter), self.geometry.detector == "arc"
        for at in range(0, rays.shape[0], slices):
            parallel(lanes.pack_rays, len(self._measured), rays, self._measured, 1, at, views)
            arguments = (image, views, cosines, sines, place, distance, bins, arc, (0.0,) * size)
            parallel(back_project_fan, image.shape[0], *arguments, multiple=BLOCK)
            parallel(lanes.unpack_image, self.grid.rows, image, self._turns, at, 0, images, True, multiple=16)
        return images

    def _anywhere(self, rays: Tensor) -> Tensor:
        """Do the same by torch operations, a view at a time."""
        padded = torch.nn.functional.pad(rays, (1, 1))
        images = rays.new_zeros(len(rays), *self.grid.shape)
        for view, (lower, share, weight) in enumerate(self.places(rays.device)):
            below, above = padded[:, view, lower], padded[:, view, lower + 1]
            images += (below + share * (above - below)) * weight
        return images

    def _spread(self, images: Tensor) -> Tensor:
        flat = images.reshape(-1, *self.grid.shape).float()
        padded = flat.new_zeros(len(flat), self.geometry.views, self.geometry.bins + 2)
        for view, (lower, share, weight) in enumerate(self.places(flat.device)):
            weighted = flat * weight
            for number, values in ((lower, (1 - share) * weighted), (lower + 1, share * weighted)):
                padded[:, view].index_add_(1, number.flatten(), values.flatten(1))
        return padded[..., 1:-1].reshape(*images.shape[:-2], *self.geometry.shape).to(images.dtype)

    def places(self, device: torch.device) -> Iterator[tuple[Tensor, Tensor, Tensor]]:
        """Yield for each view the lower bin of each pixel among padded ones, the share of the upper one, and 1/L²."""
        x = torch.as_tensor(self.grid.x, dtype=torch.float32, device=device)
        y = torch.as_tensor(self.grid.y, dtype=torch.float32, device=device)[:, None]
        (scale, offset), arc = self.bins, self.geometry.detector == "arc"
        for angle in self.geometry.view_angles:
            depth = self.geometry.source_to_isocenter + x * np.sin(angle) - y * np.cos(angle)
            across = x * np.cos(angle) + y * np.sin(angle)
            number = scale * (torch.atan2(across, depth) if arc else across / depth) + offset
            number = number.clamp(-1, self.geometry.bins)
            lower = number.floor().clamp(max=self.geometry.bins - 1)
            yield lower.long() + 1, number - lower, 1 / (depth**2 + across**2 if arc else depth**2)
