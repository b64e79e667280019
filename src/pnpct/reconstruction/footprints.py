"""Columns of the projector, pixel by pixel: the footprint of each pixel on the bins of one view.

The projector's kernels go along rays. A factorisation needs inner products of pixels, Σᵢ wᵢ aᵢⱼ aᵢₖ, and so the same
weights sorted by pixel: for each view the first bin that sees the pixel, and the weights from there on.
"""

import math

import numpy as np
from numpy.typing import NDArray

from pnpct.operators import Projector
from pnpct.operators.ray_lines import RayLines, frame_lines
from pnpct.reconstruction.factor_kernels import sort_by_pixel


class Footprints:
    """The weights aᵢⱼ of one view at a time, for all pixels.

    Args:
        A: The projector.
    """

    def __init__(self, A: Projector) -> None:
        self._tables = frame_lines(A.grid, A.geometry, A.method)
        self._bins, self._mu_water = A.geometry.bins, A.mu_water
        self._shape = A.grid.shape
        # Cells of a view follow one another in each table.
        self._starts = [
            np.searchsorted(table.measured[:, 0] // self._bins, np.arange(A.geometry.views + 1))
            for table in self._tables
        ]
        nearest = float(np.linalg.norm(A.geometry.focal_spots(), axis=1).min()) - A.grid.radius
        angle = np.diff(A.geometry.fan_angle_edges).min()
        pixel = A.grid.spacing * (math.sqrt(2) if A.method == "distance-driven" else 2 * math.sqrt(2))
        self.width = math.ceil(pixel / nearest / angle) + 3
        """Bins stored for a pixel, at least as many as it projects to."""

    def of_view(self, view: int) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
        """Return the first bin that sees each pixel (or the number of bins), and the weights (pixels, width)."""
        pixels = self._shape[0] * self._shape[1]
        first = np.full(pixels, self._bins, np.int32)
        weights = np.zeros((pixels, self.width), np.float32)
        for fill in (False, True):
            for table, starts in zip(self._tables, self._starts, strict=True):
                cells = (starts[view], starts[view + 1])
                sort_by_pixel(
                    _lines(table),
                    table.measured,
                    table.parts,
                    cells,
                    self._bins,
                    self._shape,
                    table.turns[0],
                    np.float32(self._mu_water),
                    first,
                    weights,
                    fill,
                )
        return first, weights


def _lines(table: RayLines) -> tuple[NDArray[np.float32], ...]:
    return table.edge, table.slope, table.width, table.widening, table.length
