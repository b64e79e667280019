"""The projector on a CPU: tiles of slices, in lanes, through the compiled kernels."""

import threading
from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from pnpct.arrays import Support
from pnpct.operators import lane_kernels as lanes
from pnpct.operators import strip_kernels as kernels
from pnpct.operators.lane_kernels import Array
from pnpct.operators.ray_lines import LEFT, RIGHT, RayLines
from pnpct.operators.strip_kernels import BLOCK, CHUNK, rows_together
from pnpct.operators.support import reach_of_blocks, reach_of_rows
from pnpct.operators.threads import at_once, parallel
from pnpct.operators.tiles import tile

SMALL = 4_000_000
"""Rows of pixels times strips times lanes below which one thread is faster than several: about a millisecond."""


class CpuProjector:
    """Forward and transpose of the same strips, for tensors [slice][row][col] and [slice][ray].

    The working arrays of one tile are cached between calls, because fresh memory costs as much as the work; a lock
    makes calls from several threads take turns.

    Args:
        tables: The strips of all rays.
        image_shape: Rows and columns.
        rays: Number of rays.
        support: Pixels outside which images are 0, and need not be complete; None for all.
    """

    def __init__(
        self, tables: Sequence[RayLines], image_shape: tuple[int, int], rays: int, support: Support | None = None
    ) -> None:
        self._tables, self._image_shape, self._rays = tables, image_shape, rays
        self._lines = [tuple(map(_aligned_copy, _columns(table))) for table in tables]
        self._reach = [reach_of_rows(table, support) for table in tables]
        self._buffers: dict[tuple[int, ...], Array] = {}
        self._lock = threading.Lock()

    def project(self, images: Tensor) -> Tensor:
        """Return the sums along all rays."""
        rays = np.empty((images.shape[0], self._rays), np.float32)
        source = images.numpy()
        with self._lock:
            for table, lines, reach in zip(self._tables, self._lines, self._reach, strict=True):
                size, slices = tile(images.shape[0], len(table.turns))
                image, strips = self._working_arrays(table, size)
                run = parallel if len(image) * table.strips * size > SMALL else at_once
                shape, width = (table.rows, table.cols), (0.0,) * size
                blocks = reach_of_blocks(reach, len(image), rows_together(size))
                cells = table.measured.shape[0]
                for at in range(0, images.shape[0], slices):
                    run(lanes.pack_image, image.shape[0], source, table.turns, at, LEFT, image, multiple=BLOCK)
                    arguments = (image, lines, strips, *shape, blocks, width)
                    run(kernels.project, table.strips, *arguments, multiple=CHUNK)
                    run(lanes.unpack_rays, cells, strips, table.measured, table.parts, at, rays)
        return torch.from_numpy(rays)

    def back_project(self, rays: Tensor, *, squared: bool = False) -> Tensor:
        """Return the transpose of `project`, or of the same map with each weight squared."""
        images = np.empty((rays.shape[0], *self._image_shape), np.float32)
        source = rays.numpy()
        power = (0.0,) * (2 if squared else 1)
        with self._lock:
            tables = zip(self._tables, self._lines, self._reach, strict=True)
            for number, (table, lines, reach) in enumerate(tables):
                size, slices = tile(rays.shape[0], len(table.turns))
                image, strips = self._working_arrays(table, size)
                run = parallel if len(image) * table.strips * size > SMALL else at_once
                shape, width = (table.rows, table.cols), (0.0,) * size
                blocks = reach_of_blocks(reach, len(image), rows_together(size))
                cells, rows = table.measured.shape[0], self._image_shape[0]
                for at in range(0, rays.shape[0], slices):
                    run(lanes.pack_rays, cells, source, table.measured, table.parts, at, strips)
                    arguments = (image, lines, strips, *shape, blocks, power, width)
                    run(kernels.back_project, len(image), *arguments, multiple=rows_together(size))
                    run(
                        lanes.unpack_image,
                        rows,
                        image,
                        table.turns,
                        at,
                        LEFT,
                        images,
                        number == 0,
                        multiple=BLOCK,
                    )
        return torch.from_numpy(images)

    def _working_arrays(self, table: RayLines, size: int) -> tuple[Array, Array]:
        height = -(-table.rows // BLOCK) * BLOCK
        return (
            self._buffer((height, LEFT + table.cols + RIGHT, size)),
            self._buffer((table.strips, size)),
        )

    def _buffer(self, shape: tuple[int, ...]) -> Array:
        if shape not in self._buffers:
            self._buffers[shape] = lanes.aligned(shape)
        return self._buffers[shape]


def _columns(table: RayLines) -> tuple[Array, ...]:
    return table.edge, table.slope, table.width, table.widening, table.length


def _aligned_copy(values: Array) -> Array:
    copy = lanes.aligned(values.shape)
    copy[:] = values
    return copy
