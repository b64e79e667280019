"""How much the data count in each pixel."""

import torch
from torch import Tensor

from pnpct.arrays import ConeRays, Rays
from pnpct.operators import AnyProjector
from pnpct.operators.support import part_supported
from pnpct.physics import DiagonalWeights, Sinogram
from pnpct.reconstruction.half_resolution import at_half_resolution, doubled

COVERED = 0.45
"""Rays that are taken to meet a pixel at least, over those that meet one on the mean."""

FAINT = 0.01
"""Rays of the mean weight that are added to those of a pixel, likewise: where no ray counts there is a mean too."""

SMALL = 64
"""Rows or columns of an image up to which it is not halved."""


def rays_that_count(weights: Rays | ConeRays, A: AnyProjector) -> Tensor:
    """Return 1 for each ray that has a weight in any image of a batch, and 0 for the others: rays without a batch."""
    answer: Tensor = (weights.reshape(-1, *A.range_shape) > 0).any(0)
    return answer.to(weights)


def certainty(weights: Rays | ConeRays, A: AnyProjector) -> Tensor:
    """Return how much the rays count in a pixel, over what rays of weight one count on the mean over all pixels.

    That is the mean weight of the rays that meet the pixel, times how many they are: Σ a² w over the mean of Σ a².
    Where few rays count, as at the ends of a volume or beyond the fan, AᵀWA is no convolution, whatever its diagonal:
    they are taken to be more, so that a solver leaves such pixels for later. The map is smooth, and made at half the
    resolution.

    Args:
        weights: Weights of the rays.
        A: The projector.
    """
    pairs, coarse = _coarse(weights, A)
    numbers, _ = _coarse(rays_that_count(weights, A), A)
    dims = A.domain_dims
    counted, met = coarse.gram_diagonal(pairs), coarse.gram_diagonal(numbers)
    share = part_supported(coarse.support)
    typical = met.mean() / share
    some = FAINT * typical
    mean_weight = (counted + some * counted.mean(dims, keepdim=True) / share / typical) / (met + some)
    certain: Tensor = mean_weight * (met / typical).clamp(min=COVERED)
    return certain if coarse is A else doubled(certain, (A.domain_shape[-2], A.domain_shape[-1]))


def _coarse(weights: Tensor, A: AnyProjector) -> tuple[Tensor, AnyProjector]:
    """The weights of rays in pairs, and the projector of these; of a small image the same as given."""
    if min(A.domain_shape[-2:]) <= SMALL:
        return weights, A
    nothing = torch.zeros_like(weights)
    pairs, coarse = at_half_resolution(Sinogram(nothing, DiagonalWeights(weights, A.range_shape)), A)
    return pairs.weights.diagonal, coarse
