"""The projector of a cone beam on a CPU: slabs of views through the compiled kernels."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import torch

from pnpct.arrays import Support
from pnpct.geometry import ConeBeam, VolumeGrid
from pnpct.operators.cone import border_kernels as border
from pnpct.operators.cone import sweep_kernels as kernels
from pnpct.operators.cone.cone_kernels import PAD, WIDTH
from pnpct.operators.cone.cone_lines import (
    CELLS_TOGETHER,
    Array,
    ConeLines,
    ViewHeights,
    cells_together,
    cone_lines,
    rows_together,
    view_heights,
)
from pnpct.operators.cone.sweep_kernels import MARGIN
from pnpct.operators.lane_kernels import aligned
from pnpct.operators.support import reach_of_blocks, reach_of_rows
from pnpct.operators.threads import parallel

SLAB = 1 << 21
"""Rays of the views that are treated together, with their tables, at most: they stay in the outermost cache."""


class CpuConeProjector:
    """Forward and transpose for arrays [slice][row][column] and [view][detector row][bin].

    Beside its argument and its answer it has in memory a copy of the volume, the rays of a slab of views, and 36 bytes
    for each view and bin: the tables, which would take a sixth of the time if they were made again each time.

    Args:
        grid: Where the voxels are.
        geometry: Where the rays are.
        support: Pixels outside which slices are 0, and need not be complete; None for all.
    """

    def __init__(self, grid: VolumeGrid, geometry: ConeBeam, support: Support | None = None) -> None:
        self._grid, self._geometry, self._support = grid, geometry, support
        self._together = rows_together(grid, geometry)
        self._cells_together = cells_together(geometry)
        slices, rows, cols = grid.shape
        self._packed_shape = (rows + 2 * MARGIN, cols + 2 * MARGIN, _whole(slices))

    def project(self, volume: Array) -> Array:
        """Return the sums along all rays."""
        packed = aligned(self._packed_shape)
        parallel(border.pack_volume, volume.shape[1], volume, MARGIN, packed)
        rays = np.empty(self._geometry.shape, np.float32)
        for slab in self._slabs:
            for table in slab.tables:
                sums = self._packed_rays(table)
                cells = -(-table.groups // (torch.get_num_threads() * table.groups_of_a_cell))
                # One piece of each thread: every piece goes through the whole volume.
                parallel(
                    kernels.project,
                    table.groups,
                    packed.reshape(-1),
                    *self._arguments(slab, table),
                    sums.reshape(-1),
                    multiple=cells * table.groups_of_a_cell,
                )
                parallel(border.unpack_rays, table.cells, sums, table.place, slab.heights.cells, rays[slab.views], PAD)
        return rays

    def back_project(self, rays: Array, *, squared: bool = False) -> Array:
        """Return the transpose of `project`, or of the same map with each weight squared."""
        packed = aligned(self._packed_shape)
        power = (0.0,) * (2 if squared else 1)
        for slab in self._slabs:
            for table in slab.tables:
                values = self._packed_rays(table)
                measured = rays[slab.views]
                parallel(border.pack_rays, table.cells, measured, table.place, slab.heights.cells, values, PAD, squared)
                parallel(
                    kernels.back_project,
                    table.rows,
                    packed.reshape(-1),
                    *self._arguments(slab, table),
                    values.reshape(-1),
                    power,
                    multiple=self._together,
                )
        volume = np.empty(self._grid.shape, np.float32)
        parallel(border.unpack_volume, volume.shape[1], packed, MARGIN, volume)
        return volume

    @cached_property
    def _slabs(self) -> list["_Slab"]:
        slabs = []
        step = max(1, SLAB // (self._geometry.bins * _whole(self._geometry.rows)))
        for first in range(0, self._geometry.views, step):
            views = slice(first, min(first + step, self._geometry.views))
            geometry = self._geometry[views]
            lines = cone_lines(self._grid, geometry, self._cells_together)
            tables = [_table(each, self._geometry.bins, self._reach(each)) for each in lines]
            slabs.append(_Slab(views, view_heights(self._grid, geometry), tables))
        return slabs

    def _reach(self, lines: ConeLines) -> Array:
        return reach_of_blocks(reach_of_rows(lines.strips, self._support), lines.strips.rows, self._together)

    def _packed_rays(self, table: "_Table") -> Array:
        """Return zeros, [cell][PAD + detector row], with PAD more in front of the first and after the last."""
        long = PAD + _whole(self._geometry.rows)
        return aligned((table.cells + 1, long))

    def _arguments(self, slab: "_Slab", table: "_Table") -> tuple[Any, ...]:
        rows, cols, slices = self._packed_shape
        if table.turn == 0:
            steps = (MARGIN * (cols + 1) * slices, cols * slices, slices)
        else:  # rows of the turned image are columns from the left, and its columns rows from the lowest
            steps = (((rows - MARGIN - 1) * cols + MARGIN) * slices, slices, -cols * slices)
        heights = (slab.heights.low, slab.heights.rise, slab.heights.step, self._geometry.rows)
        shape = (table.rows, table.cols, self._grid.slices)
        window = min(slices, _whole(int(table.farthest * slab.heights.step * self._geometry.rows) + 2 + WIDTH))
        return steps, table.lines, table.kernel_cells, heights, shape, table.reach, self._together, window


@dataclass(frozen=True)
class _Table:
    """`ConeLines` as the kernels take them."""

    turn: int
    rows: int
    cols: int
    groups: int
    groups_of_a_cell: int
    cells: int
    farthest: float
    reach: Array
    lines: tuple[Array, ...]
    kernel_cells: tuple[Any, ...]
    place: tuple[Any, ...]


@dataclass(frozen=True)
class _Slab:
    views: slice
    heights: ViewHeights
    tables: list[_Table]


def _table(lines: ConeLines, bins: int, reach: Array) -> _Table:
    strips = lines.strips
    if strips.parts == 1:
        first, of_a_cell = lines.group, 1
    else:  # the parts of a cell have one t too
        parts = np.arange(0, strips.parts, CELLS_TOGETHER)
        first, of_a_cell = np.append(np.arange(strips.strips)[:: strips.parts, None] + parts, strips.strips), len(parts)
    half = (strips.rows - 1) / 2
    return _Table(
        turn=strips.turns[0],
        rows=strips.rows,
        cols=strips.cols,
        groups=len(first) - 1,
        groups_of_a_cell=of_a_cell,
        cells=strips.measured.size,
        farthest=float((lines.part + half * np.abs(lines.change)).max()),
        reach=reach,
        lines=(strips.edge, strips.slope, strips.width, strips.widening, strips.length),
        kernel_cells=(lines.view, lines.part, lines.change, first, strips.parts),
        place=(lines.view, strips.measured[:, 0] % bins, strips.length[:: strips.parts], lines.nearness),
    )


def _whole(number: int) -> int:
    """Round up to whole vectors."""
    return -(-number // WIDTH) * WIDTH
