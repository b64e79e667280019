"""The projector on a GPU: tiles of slices, in lanes, through Triton's kernels."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import pad

from pnpct.operators import triton_kernels as kernels
from pnpct.operators.ray_lines import LEFT, RIGHT, RayLines
from pnpct.operators.tiles import tile
from pnpct.operators.torch_projector import turned, turned_back

NUMBERS = 512
"""Sums that one program of a kernel holds: four in each of its 128 threads, which read four lanes at once."""

_SLACK = 0.25  # of a grain: more than rounding


class TritonProjector:
    """Forward and transpose of the same strips, for tensors [slice][row][col] and [slice][ray].

    The tables stay on the device, and a call copies nothing to it or from it. Two runs have the same bytes.
    """

    def __init__(
        self, tables: Sequence[RayLines], image_shape: tuple[int, int], rays: int, device: torch.device
    ) -> None:
        self._image_shape, self._rays = image_shape, rays
        self._tables = [_table(lines, device) for lines in tables]

    def project(self, images: Tensor) -> Tensor:
        """Return the sums along all rays."""
        size, slices = tile(len(images), len(self._tables[0].lines.turns))
        filled = pad(images, (0, 0, 0, 0, 0, -len(images) % slices))
        rays = images.new_empty(self._rays + 1, len(filled))  # the last one stands for what was not measured
        for table in self._tables:
            lines, strips = table.lines, NUMBERS // size
            sums = images.new_empty(lines.strips, size)
            for some, answer in zip(filled.split(slices), rays.split(slices, 1), strict=True):
                pixels = pad(turned(some, lines).permute(1, 2, 3, 0), (0, 0, 0, 0, LEFT, RIGHT)).contiguous()
                numbers = (lines.strips, lines.rows, lines.cols, pixels.stride(0))
                with torch.cuda.device_of(images):
                    kernels.project[(-(-lines.strips // strips),)](
                        pixels, *table.strips, sums, *numbers, SIZE=size, STRIPS=strips
                    )
                cells = sums.view(-1, lines.parts, size).sum(1) * table.length
                answer[table.measured] = cells.view(-1, len(lines.turns), slices)
        return rays[:-1, : len(images)].T.contiguous()

    def back_project(self, rays: Tensor, *, squared: bool = False) -> Tensor:
        """Return the transpose of `project`, or of the same map with each weight squared."""
        size, slices = tile(len(rays), len(self._tables[0].lines.turns))
        down, across = block(size)
        images = rays.new_zeros(len(rays) + -len(rays) % slices, *self._image_shape)
        padded = pad(rays, (0, 1, 0, -len(rays) % slices)).T.contiguous()
        for table in self._tables:
            lines, length = table.lines, table.length.square() if squared else table.length
            pixels = rays.new_empty(lines.rows, lines.cols, len(lines.turns), slices)
            for some, answer in zip(padded.split(slices, 1), images.split(slices), strict=True):
                cells = some[table.measured].flatten(1) * length
                with torch.cuda.device_of(rays):
                    kernels.back_project[(-(-lines.cols // across), -(-lines.rows // down))](
                        pixels,
                        *table.strips,
                        cells,
                        *table.pencils,
                        len(lines.apex),
                        table.apex_width,
                        lines.rows,
                        lines.cols,
                        SIZE=size,
                        PARTS=lines.parts,
                        DOWN=down,
                        ACROSS=across,
                        GRAINS=table.pencils[-1].shape[1],
                        SQUARED=squared,
                    )
                answer += turned_back(pixels.permute(3, 0, 1, 2), lines, self._image_shape)
        return images[: len(rays)]


@dataclass(frozen=True, eq=False)
class _Table:
    """The lines of a table on a device, its strips sorted in each pencil as they lie from left to right.

    Args:
        lines: The table.
        strips: Edge, slope, width and widening.
        length: Path per row of each cell.
        measured: Its rays.
        pencils: What strips are found by. Eight numbers of each pencil: its apex (3), the least slope of left edges,
            the least and the greatest of right ones, grains per slope, strips per slope; then its first strip; then the
            first strip whose right edge has the slope of each grain, or more.
        apex_width: Columns between the edges of a strip where the left ones meet: 0, or 1 of Joseph's.
    """

    lines: RayLines
    strips: tuple[Tensor, ...]
    length: Tensor
    measured: Tensor
    pencils: tuple[Tensor, ...]
    apex_width: float


def block(size: int) -> tuple[int, int]:
    """Return rows and columns of the pixels of one program, for a number of lanes."""
    across = max(8, int(2 ** (np.log2(NUMBERS // size) // 2)))
    return NUMBERS // size // across, across


def _table(lines: RayLines, device: torch.device) -> _Table:
    """Sort the strips, and tabulate where among them slopes begin."""
    _, row, down = lines.apex[lines.pencil].astype(np.float64).T
    cells = np.lexsort((lines.slope[:: lines.parts] * down, lines.pencil))
    strips = (cells[:, None] * lines.parts + np.arange(lines.parts)).ravel()
    edge, slope, width, widening = (values[strips] for values in (lines.edge, lines.slope, lines.width, lines.widening))
    down, row = np.repeat(down[cells], lines.parts), np.repeat(row[cells], lines.parts)
    ends = np.searchsorted(lines.pencil[cells], np.arange(len(lines.apex) + 1)) * lines.parts
    grains = 4 * 2 ** math.ceil(math.log2(np.diff(ends).max()))
    numbers, starts = [], []
    for apex, first, last in zip(lines.apex, ends[:-1], ends[1:], strict=True):
        of_left = (slope * down)[first:last].astype(np.float64)
        of_right = of_left + (widening * down)[first:last]
        lowest, highest = of_right[0], of_right[-1]
        grain = max(highest - lowest, 1e-6) / (grains - 2)
        apart = np.diff(of_right).min(initial=np.inf)
        numbers.append((*apex, of_left[0], lowest, highest, 1 / grain, 1 / max(apart, 1e-9)))
        starts.append(first + np.searchsorted(of_right, lowest + (np.arange(grains) - _SLACK) * grain))
    length = lines.length[strips[:: lines.parts]]
    return _Table(
        lines=lines,
        strips=tuple(torch.from_numpy(values).to(device) for values in (edge, slope, width, widening)),
        length=torch.from_numpy(length).to(device)[:, None],
        measured=torch.from_numpy(lines.measured[cells]).to(device, torch.int64),
        pencils=(
            torch.tensor(numbers, dtype=torch.float32, device=device),
            torch.from_numpy(ends).to(device, torch.int32),
            torch.tensor(np.array(starts), dtype=torch.int32, device=device),
        ),
        apex_width=float(np.abs(width + widening * row).max()),
    )
