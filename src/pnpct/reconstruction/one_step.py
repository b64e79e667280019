"""Two solvers of the data step without iterations: the exact one for small images, and the paper's approximation."""

from functools import lru_cache

import torch
from torch import Tensor

from pnpct.arrays import Image
from pnpct.operators import Projector
from pnpct.physics import Sinogram
from pnpct.reconstruction.fbp import fbp
from pnpct.reconstruction.normal_equations import Solve, mean_diagonal

LARGEST = 128 * 128
"""Pixels of the largest image that the dense factor is made for: 2 GiB, and about a minute."""

_COLUMNS = 64


def dense_cholesky(sinogram: Sinogram, A: Projector) -> Solve:
    """Make a solver that is exact: the Cholesky factor of the whole matrix AᵀWA + β, in float64.

    It is the reference for the other solvers. AᵀWA is dense (all pixels meet on some ray), so that the factor of N
    pixels takes 8 N² bytes.

    Raises:
        ValueError: If the image is too large, or (when it solves) there is a batch of them.
    """
    pixels = A.grid.rows * A.grid.cols
    if pixels > LARGEST:
        raise ValueError(
            f"Dense Cholesky takes images of at most {LARGEST} pixels, got {A.grid.rows} x {A.grid.cols}; use "
            "the solver fourier or cholesky."
        )
    matrix = normal_matrix(sinogram, A)

    @lru_cache(maxsize=1)
    def factor(beta: float) -> Tensor:
        answer: Tensor = torch.linalg.cholesky(matrix + beta * torch.eye(pixels).double())
        return answer

    def solve(b: Image, beta: Tensor, _x: Image) -> Image:
        if beta.numel() != 1:
            raise ValueError(f"Dense Cholesky takes one image at a time, got a batch of {beta.numel()}.")
        right = b.double().reshape(pixels, 1)
        return torch.cholesky_solve(right, factor(float(beta)).to(b.device)).reshape(b.shape).to(b)

    return solve


def normal_matrix(sinogram: Sinogram, A: Projector) -> Tensor:
    """Return AᵀWA as a matrix (pixels, pixels), column by column, in float64."""
    W, pixels = sinogram.weights, A.grid.rows * A.grid.cols
    matrix = torch.empty(pixels, pixels, dtype=torch.float64)
    for first in range(0, pixels, _COLUMNS):
        last = min(first + _COLUMNS, pixels)
        points = torch.zeros(last - first, pixels, device=sinogram.line_integrals.device)
        points[torch.arange(last - first), torch.arange(first, last)] = 1.0
        columns = A.T(W(A(points.reshape(-1, *A.grid.shape))))
        matrix[:, first:last] = columns.reshape(-1, pixels).T
    return (matrix + matrix.T) / 2


def fbp_blend(sinogram: Sinogram, A: Projector) -> Solve:
    """Make the paper's one-step approximation: x = (FBP(y) + β (v − u)) / (1 + β), β in mean diagonals of AᵀWA.

    It is exact only if AᵀWA is the identity, which holds for ramp-filter weighting and not for statistical weights;
    in soft tissue it errs several times more than they do.

    References:
        The paper, section 2.2, after Eq. (5).
    """
    scale = mean_diagonal(sinogram, A)
    image = fbp(sinogram.line_integrals, A)
    AtWy = A.T(sinogram.weights(sinogram.line_integrals))

    def solve(b: Image, beta: Tensor, _x: Image) -> Image:
        return (image + (b - AtWy) / scale) / (1 + beta / scale)

    return solve
