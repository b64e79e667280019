"""The weights W of the data term, the inverse covariance of the line integrals."""

from functools import cached_property
from typing import Any, TypeAlias, final

import numpy as np
import scipy
import torch
from jaxtyping import Float
from numpy.typing import NDArray
from torch import Tensor
from typing_extensions import override

from pnpct.arrays import ConeRays, Rays
from pnpct.operators.linear_operator import LinearOperator, Shape


@final
class DiagonalWeights(LinearOperator):
    """Weights for rays with independent noise: W = diag(values).

    Args:
        values: 1/variance of each ray, ≥ 0; 0 leaves a ray out. A batch of rays meets a batch of weights one
            by one.
        rays: Shape of the rays without a batch, that of their geometry; views and bins if it is not given.

    Raises:
        ValueError: If a weight is negative or not finite, all are zero, or they are not for these rays.

    Example:
        >>> weights = DiagonalWeights(torch.tensor([[4.0, 0.0]]))
        >>> weights(torch.ones(1, 2)).tolist(), weights.whiten(torch.ones(1, 2)).tolist()
        ([[4.0, 0.0]], [[2.0, 0.0]])
    """

    def __init__(self, values: Rays | ConeRays, rays: Shape | None = None) -> None:
        unusable = ~(values.isfinite() & (values >= 0))
        if bool(unusable.any()):
            raise ValueError(
                f"Weights must be finite and not negative, but {int(unusable.sum())} of {values.numel()} are "
                "not; give a ray that should not count the weight 0."
            )
        if not bool((values > 0).any()):
            raise ValueError("Weights need at least one ray of weight above zero, but all are zero.")
        self.values = values
        self.domain_shape = self.range_shape = tuple(values.shape[-2:]) if rays is None else rays
        if tuple(values.shape[values.ndim - len(self.domain_shape) :]) != self.domain_shape:
            raise ValueError(f"The weights must end in {self.domain_shape}, got {tuple(values.shape)}.")

    @property
    def diagonal(self) -> Rays | ConeRays:
        """The weight of each ray."""
        return self.values

    @property
    @override
    def T(self) -> "DiagonalWeights":
        return self

    @override
    def forward(self, x: Rays | ConeRays) -> Rays | ConeRays:
        """Return W x."""
        return self.values * x

    @override
    def adjoint(self, y: Rays | ConeRays) -> Rays | ConeRays:
        """Return Wᵀ y = W y."""
        return self.forward(y)

    def whiten(self, rays: Rays | ConeRays) -> Rays | ConeRays:
        """Return √W x: noise of covariance W⁻¹ becomes noise of covariance one. whitenᵀ whiten = W."""
        return self.values.sqrt() * rays


@final
class BandedWeights(LinearOperator):
    """Weights for noise that is correlated along the detector: W = Σ⁻¹, Σ banded in each view.

    Crosstalk between cells makes such noise; for cells mixed by B, z = B n + e, the line integrals have
    Σ = D (B diag(n) Bᵀ + σ² I) D with D = diag(1/z). W itself is full, and is applied by a banded Cholesky
    factorisation Σ = L Lᵀ of each view, in float64 on the CPU. It has no gradient.

    Args:
        covariance: Number b of the bands holds the covariances of each bin j with bin j + b; number 0 the
            variances. What lies beyond the last bin is not looked at.

    Raises:
        ValueError: If there are more bands than bins, a number is not finite, or Σ is not positive definite.

    Example:
        >>> bands = torch.tensor([[[2.0, 2.0, 2.0], [1.0, 1.0, 0.0]]])  # 2 on the diagonal, 1 beside it
        >>> BandedWeights(bands)(torch.tensor([[3.0, 4.0, 3.0]])).tolist()
        [[1.0..., 1.0..., 1.0...]]
    """

    def __init__(self, covariance: Float[Tensor, "views bands bins"]) -> None:
        views, bands, bins = covariance.shape
        if not 1 <= bands <= bins:
            raise ValueError(f"A covariance of {bins} bins has 1 to {bins} bands, got {bands}.")
        inside = torch.arange(bins) + torch.arange(bands)[:, None] < bins
        banded = torch.where(inside, covariance.detach().cpu().double(), 0.0)
        if not bool(banded.isfinite().all()):
            raise ValueError("A covariance must be finite, but some of its bands have NaN or infinity.")
        # All views end to end are one banded matrix: nothing couples the last bin of a view to the next view.
        ends = banded.permute(1, 0, 2).reshape(bands, views * bins).numpy()
        self._factor: NDArray[np.float64]
        self._factor, failed = scipy.linalg.lapack.dpbtrf(ends, lower=1)
        if failed:
            view, position = divmod(failed - 1, bins)
            raise ValueError(
                f"A covariance must be positive definite, but that of view {view} is not, from bin "
                f"{position} on; are the variances large enough for the covariances beside them?"
            )
        self._like = covariance.detach().new_empty(0)
        self.domain_shape = self.range_shape = (views, bins)

    @cached_property
    def diagonal(self) -> Float[Tensor, "views bins"]:
        """The diagonal of W, 1/variance of each ray given all others.

        References:
            Takahashi, Fagan and Chin, 8th PICA Conference (1973): the inverse within the band from L alone.
        """
        views, bins = self.domain_shape
        factor = self._factor.reshape(-1, views, bins)
        scaled = factor[1:] / factor[0]
        reach = len(scaled)
        diagonal = np.empty((views, bins))
        corner = np.zeros((views, reach, reach))  # W for the bins after this one
        for number in reversed(range(bins)):
            below = scaled[:, :, number].T
            column = -np.einsum("vik,vk->vi", corner, below)
            diagonal[:, number] = factor[0, :, number] ** -2.0 - (column * below).sum(-1)
            if reach:
                corner[:, 1:, 1:] = corner[:, :-1, :-1].copy()
                corner[:, 0, 0] = diagonal[:, number]
                corner[:, 1:, 0] = corner[:, 0, 1:] = column[:, :-1]
        return torch.from_numpy(diagonal).to(self._like)

    @property
    @override
    def T(self) -> "BandedWeights":
        return self

    @override
    def forward(self, x: Rays) -> Rays:
        """Return W x, the solution of Σ (W x) = x."""
        return self._solve(scipy.linalg.lapack.dpbtrs, x, lower=1)

    @override
    def adjoint(self, y: Rays) -> Rays:
        """Return Wᵀ y = W y."""
        return self.forward(y)

    def whiten(self, rays: Rays) -> Rays:
        """Return L⁻¹ x: noise of covariance Σ becomes noise of covariance one. whitenᵀ whiten = W."""
        return self._solve(scipy.linalg.lapack.dtbtrs, rays, uplo="L")

    def _solve(self, solver: Any, rays: Tensor, **triangle: Any) -> Tensor:
        columns = rays.detach().cpu().double().reshape(-1, self._factor.shape[1]).numpy().T
        solution, _ = solver(self._factor, columns, **triangle)
        return torch.from_numpy(np.ascontiguousarray(solution.T)).reshape(rays.shape).to(rays)


Weights: TypeAlias = DiagonalWeights | BandedWeights
"""A `LinearOperator` on rays that is its own adjoint, and knows its `diagonal` and how to `whiten`."""
