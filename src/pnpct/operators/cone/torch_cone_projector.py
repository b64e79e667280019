"""A cone beam's projector in plain torch operations: for any device, and the reference for the compiled kernels."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import pad

from pnpct.geometry import ConeBeam, VolumeGrid
from pnpct.operators.cone.cone_lines import ConeLines, cells_together, cone_lines, rows_together, view_heights
from pnpct.operators.ray_lines import LEFT, NARROWEST, RIGHT, TAPS

_ELEMENTS = 1 << 23
"""Numbers in the largest temporary array."""


@dataclass(frozen=True)
class _Piece:
    """Some cells of one view and one frame, over all rows of the turned image.

    Args:
        turn: Quarter turns of the image.
        view: Number of the view.
        bins: The cells.
        place: First pixel under each strip, rows times columns with their margins: (cells, rows).
        weights: Share of each tap, times the path through the row: (taps, cells, rows).
        overlaps: Share of each slice in each detector row: (cells, groups of rows, detector rows, slices).
        group: Number of the group of each row.
        path: Path of the rays of each detector row over that in the plane: (cells, detector rows).
    """

    turn: int
    view: int
    bins: Tensor
    place: Tensor
    weights: Tensor
    overlaps: Tensor
    group: Tensor
    path: Tensor


class TorchConeProjector:
    """Forward and transpose of the same strips, for tensors [slice][row][column] and [view][detector row][bin].

    Slower than compiled kernels by two orders of magnitude. On a GPU the transpose adds in no fixed order, so that two
    runs differ by rounding.
    """

    def __init__(self, grid: VolumeGrid, geometry: ConeBeam, device: torch.device) -> None:
        self._grid, self._geometry, self._device = grid, geometry, device
        self._together = rows_together(grid, geometry)
        self._cells_together = cells_together(geometry)

    def project(self, volume: Tensor) -> Tensor:
        """Return the sums along all rays."""
        rays = volume.new_zeros(self._geometry.shape)
        turned = [pad(torch.rot90(volume, -turn, (1, 2)), (LEFT, RIGHT)).flatten(1) for turn in (0, 1)]
        for piece in self._pieces():
            pixels = turned[piece.turn]
            taps = [pixels[:, piece.place + tap] * piece.weights[tap] for tap in range(TAPS)]
            slices = sum(taps[1:], taps[0])
            groups = slices.new_zeros(*slices.shape[:2], piece.overlaps.shape[1]).index_add_(2, piece.group, slices)
            values = torch.einsum("zcg,cgrz->rc", groups, piece.overlaps) * piece.path.T
            rays[piece.view].index_add_(1, piece.bins, values)
        return rays

    def back_project(self, rays: Tensor, *, squared: bool = False) -> Tensor:
        """Return the transpose of `project`, or of the same map with each weight squared."""
        power = 2 if squared else 1
        volume = rays.new_zeros(self._grid.shape)
        turned = [torch.zeros_like(pad(torch.rot90(volume, -turn, (1, 2)), (LEFT, RIGHT))) for turn in (0, 1)]
        for piece in self._pieces():
            values = rays[piece.view][:, piece.bins] * piece.path.T**power
            groups = torch.einsum("rc,cgrz->zcg", values, piece.overlaps**power)
            slices = groups[:, :, piece.group]
            for tap in range(TAPS):
                weighted = (slices * piece.weights[tap] ** power).flatten(1)
                turned[piece.turn].flatten(1).index_add_(1, (piece.place + tap).flatten(), weighted)
        for turn, image in enumerate(turned):
            volume += torch.rot90(image[:, :, LEFT:-RIGHT], turn, (1, 2))
        return volume

    def _pieces(self) -> Iterator[_Piece]:
        for view in range(self._geometry.views):
            for lines in cone_lines(self._grid, self._geometry[view : view + 1], self._cells_together):
                groups = -(-lines.strips.rows // self._together)
                numbers = groups * self._geometry.rows * self._grid.slices
                step = max(1, _ELEMENTS // max(numbers, lines.strips.rows * self._grid.slices))
                for first in range(0, lines.strips.strips, step):
                    yield self._piece(view, lines, slice(first, first + step))

    def _piece(self, view: int, lines: ConeLines, chosen: slice) -> _Piece:
        strips, heights = lines.strips, view_heights(self._grid, self._geometry[view : view + 1])
        cells = np.arange(strips.strips)[chosen] // strips.parts

        def tensor(values: object) -> Tensor:
            return torch.as_tensor(values, device=self._device)

        edge, slope, width, widening, length = (
            tensor(values[chosen])[:, None]
            for values in (strips.edge, strips.slope, strips.width, strips.widening, strips.length)
        )
        row = torch.arange(strips.rows, device=self._device)
        from_middle = row - (strips.rows - 1) / 2
        left, wide = edge + slope * from_middle, (width + widening * from_middle).clamp(min=NARROWEST)
        column = left.floor().clamp(-LEFT, strips.cols)
        shares = [((left + wide - column - tap) / wide).clamp(0, 1) for tap in range(1, TAPS)]
        falling = [torch.ones_like(left), *shares, torch.zeros_like(left)]
        group = row // self._together
        middles = torch.stack([from_middle[group == number].mean() for number in range(int(group[-1]) + 1)])
        part = tensor(lines.part[cells])[:, None] + tensor(lines.change[cells])[:, None] * middles
        edges = torch.arange(self._geometry.rows + 1, device=self._device)
        ends = float(heights.low[0]) + part[..., None].double() * (float(heights.rise[0]) + edges * heights.step)
        step = (part.double() * heights.step)[..., None, None]
        slices = torch.arange(self._grid.slices, device=self._device)
        low = torch.maximum(ends[..., :-1, None], slices)
        high = torch.minimum(ends[..., 1:, None], slices + 1.0)
        rise = tensor(heights.cells[0]) * tensor(lines.nearness[cells])[:, None]
        return _Piece(
            turn=strips.turns[0],
            view=view,
            bins=tensor(strips.measured[cells, 0] % self._geometry.bins).long(),
            place=row * (LEFT + strips.cols + RIGHT) + column.long() + LEFT,
            weights=torch.stack([falling[tap] - falling[tap + 1] for tap in range(TAPS)]) * length,
            # Behind the focal spot, always beside the image, t is negative.
            overlaps=torch.where(step > 0, (high - low).clamp(min=0) / step, 0.0).float(),
            group=group,
            path=(1 + rise**2).sqrt(),
        )
