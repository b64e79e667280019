"""Conjugate gradients preconditioned by a sparse Cholesky factor of the inverse.

AᵀWA is dense, with entries that fall like weight/distance: the Green's function of an operator of first order. The
inverse of such a matrix has a nearly sparse Cholesky factor once the pixels are ordered from fine to coarse. A pixel j
at scale ℓ_j (a power of √2 times the spacing) keeps s_j = {j} and the later pixels within `radius · ℓ_j`, and with H
the matrix AᵀWA + β

    L[s_j, j] = H[s_j, s_j]⁻¹ e₁ / √(e₁ᵀ H[s_j, s_j]⁻¹ e₁),      H⁻¹ ≈ L Lᵀ

which is the best such factor in the Kullback-Leibler sense. L Lᵀ is positive definite whatever the errors. It takes
in what no Fourier filter can, weights that depend on the direction, and so leads where β is small.

References:
    Schäfer, Katzfuss and Owhadi, SIAM J. Sci. Comput. 43 (2021) A2019.
"""

import math
from dataclasses import dataclass
from functools import partial

import numpy as np
import scipy
import torch
from numpy.typing import NDArray
from torch import Tensor

from pnpct.arrays import Image
from pnpct.operators import Projector
from pnpct.operators.threads import parallel
from pnpct.physics import Sinogram
from pnpct.reconstruction.factor_kernels import add_view, factorise, list_members
from pnpct.reconstruction.footprints import Footprints
from pnpct.reconstruction.normal_equations import INNER_ITERATIONS, Operator, Solve, warm_started

RADIUS = 3.0


def cholesky(
    sinogram: Sinogram, A: Projector, *, inner_iterations: int = INNER_ITERATIONS, radius: float = RADIUS
) -> Solve:
    """Make a solver that takes conjugate-gradient steps, preconditioned with the sparse inverse Cholesky factor.

    The factor is made on the CPU, once for each β.

    Raises:
        ValueError: If (when it solves) there is a batch of images, or the radius is below 1.
    """

    def for_penalty(beta: Tensor) -> Operator:
        if beta.numel() != 1:
            raise ValueError(f"The solver cholesky takes one image at a time, got a batch of {beta.numel()}.")
        factor = inverse_factor(sinogram, A, float(beta), radius=radius)

        def precondition(image: Image) -> Image:
            flat = image.detach().cpu().double().numpy().ravel()
            return torch.from_numpy(factor @ (factor.T @ flat)).reshape(image.shape).to(image)

        return precondition

    return warm_started(sinogram, A, inner_iterations, for_penalty)


def inverse_factor(
    sinogram: Sinogram, A: Projector, beta: float, *, radius: float = RADIUS
) -> "scipy.sparse.csc_array":
    """Return the sparse L with L Lᵀ ≈ (AᵀWA + β)⁻¹, rows numbered as pixels, columns from fine to coarse.

    Args:
        sinogram: Its weights' diagonal is W.
        A: The projector.
        beta: β in the units of AᵀWA, > 0.
        radius: Reach of the factor in units of the scale; 2 keeps about 9 numbers per pixel, 3 about 22.
    """
    if not (math.isfinite(radius) and radius >= 1):
        raise ValueError(f"The radius of the sparse factor must be at least 1, got {radius}.")
    pattern = _pattern(A.grid.shape, radius)
    weights = sinogram.weights.diagonal.detach().cpu().float().numpy().reshape(A.geometry.shape)
    footprints = Footprints(A)
    columns = pattern.starts.size - 1
    packed = np.zeros(pattern.blocks[-1], np.float32)
    for view in range(A.geometry.views):
        first, shares = footprints.of_view(view)
        parallel(add_view, columns, first, shares, np.ascontiguousarray(weights[view]), *pattern.arrays, packed)
    values = np.empty(pattern.members.size)
    parallel(factorise, columns, packed, beta, pattern.starts, pattern.blocks, values)
    pixels = A.grid.rows * A.grid.cols
    return scipy.sparse.csc_array((values, pattern.members, pattern.starts), shape=(pixels, columns))


@dataclass(frozen=True)
class _Pattern:
    """Which pixels belong to each column: `members[starts[c] : starts[c+1]]`; `blocks` places their matrices."""

    starts: NDArray[np.int64]
    members: NDArray[np.int64]
    blocks: NDArray[np.int64]

    @property
    def arrays(self) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        return self.starts, self.members, self.blocks


def _pattern(shape: tuple[int, int], radius: float) -> _Pattern:
    """Order the pixels by scale, fine ones first, and list each with the later ones near it."""
    row, col = (index.ravel() for index in np.indices(shape))
    level = np.zeros(row.size)
    for power in range(1, int(math.log2(max(2, *shape))) + 1):
        step = 2**power
        on_grid = (row % step == 0) & (col % step == 0)
        between = (row % step == step // 2) & (col % step == step // 2)  # the middles of the squares: half a level
        level[on_grid], level[between] = power, power - 0.5
    # Within a scale any order will do; a shuffled one does not favour a direction.
    order = np.lexsort((np.random.default_rng(0).random(row.size), level))
    rank = np.empty(row.size, np.int64)
    rank[order] = np.arange(row.size)
    reach = radius * 2.0**level
    sizes = np.empty(row.size + 1, np.int64)
    sizes[0] = 0
    listing = partial(list_members, order, rank.reshape(shape), reach)
    listing(sizes[:-1], sizes, np.empty(0, np.int64))
    starts = np.cumsum(sizes)
    members = np.empty(starts[-1], np.int64)
    listing(starts[:-1], sizes, members)
    count = np.diff(starts)
    return _Pattern(starts, members, np.concatenate([[0], np.cumsum(count * (count + 1) // 2)]))
