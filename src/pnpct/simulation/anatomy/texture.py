"""Smooth random fields in three dimensions, the same at every look."""

import math
from collections.abc import Mapping

import numpy as np
import scipy.sparse
from numpy.typing import NDArray

from pnpct.geometry import ImageGrid

HALF_WIDTH = 400.0
"""Fields are laid out over ±400 mm in x and y; beyond they are continued by what is there at the edge."""


class Texture:
    """Gaussian fields of mean 0 and variance 1 in the slice at one height.

    White noise on a lattice, blurred by a Gaussian onto the pixels. Every lattice plane has its own seed, so
    that a slice needs only the planes around it, and a body is the same on every grid and in whatever order its
    slices are asked for.

    Args:
        seed: Of the body.
        z: Height of the slice, mm.
        grid: Where the pixels are.
    """

    def __init__(self, seed: int, z: float, grid: ImageGrid) -> None:
        self._seed, self._z, self._grid = seed, z, grid
        self._fields: dict[tuple[float, int], NDArray[np.float32]] = {}

    def field(self, length: float, *, which: int = 0) -> NDArray[np.float32]:
        """Return the field of one correlation length.

        Args:
            length: Standard deviation of the Gaussian that blurs the noise, mm, > 0.
            which: Number of the field; those of different numbers are independent.
        """
        key = (length, which)
        if key not in self._fields:
            self._fields[key] = self._drawn(length, which)
        return self._fields[key]

    def sum(self, deviations: Mapping[float, float], *, which: int = 0) -> NDArray[np.float32]:
        """Return the sum of fields with a standard deviation for each correlation length in mm."""
        total = np.zeros(self._grid.shape, dtype=np.float32)
        for length, deviation in deviations.items():
            total += np.float32(deviation) * self.field(length, which=which)
        return total

    def _drawn(self, length: float, which: int) -> NDArray[np.float32]:
        side = 2 * math.ceil(HALF_WIDTH / length) + 1
        middle = round(self._z / length)
        planes = np.arange(middle - 4, middle + 5)
        weights = np.exp(-0.5 * (self._z / length - planes) ** 2)
        weights /= np.linalg.norm(weights)
        white = np.zeros((side, side), dtype=np.float32)
        for plane, weight in zip(planes.tolist(), weights.tolist(), strict=True):
            # Seeds are not negative: planes count from far below.
            seeds = [self._seed, which, round(1000 * length), plane + 10**6]
            drawn = np.random.Generator(np.random.SFC64(seeds)).standard_normal((side, side), dtype=np.float32)
            white += np.float32(weight) * drawn
        rows, cols = _blur(self._grid.y, length, side), _blur(self._grid.x, length, side)
        field: NDArray[np.float32] = (cols @ (rows @ white).T).T
        return field


def _blur(positions: NDArray[np.float64], length: float, side: int) -> scipy.sparse.csr_array:
    """Rows of a Gaussian around each position, over the lattice, each of norm 1."""
    places = np.clip(positions / length + side // 2, 0, side - 1)
    near = np.round(places).astype(int)[:, None] + np.arange(-4, 5)
    weights = np.where((near >= 0) & (near < side), np.exp(-0.5 * (places[:, None] - near) ** 2), 0.0)
    weights /= np.linalg.norm(weights, axis=1, keepdims=True)
    count = len(positions)
    starts = np.arange(count + 1) * 9
    matrix = (weights.ravel().astype(np.float32), np.clip(near, 0, side - 1).ravel(), starts)
    return scipy.sparse.csr_array(matrix, shape=(count, side))
