"""A denoiser of slices that also looks at their neighbours."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import torch
from torch.nn import functional

from pnpct.arrays import Image, Volume
from pnpct.denoisers.settings import denoiser_settings

_SIDE = 3
"""Pixels: slices are compared over squares of so many."""


@dataclass(frozen=True, eq=False)
class AcrossSlices:
    """Denoise each slice of a volume, then average it with its neighbours wherever these agree with it.

    What noise a denoiser leaves is another in each slice; anatomy is mostly the same in thin slices. With d = D(v),

        result_k = Σ_j a_kj d_j / Σ_j a_kj,    a_kj = exp(−⟨(d_j − d_k)²⟩ / 2 s²),    |j − k| ≤ reach

    where ⟨ ⟩ is the mean over 3 × 3 pixels and s the agreement: where a vessel or the border of the lung has moved from
    slice to slice, each slice keeps its own. It costs next to nothing beside a network.

    Args:
        denoise: D, for one slice; of total variation, a network, or your own.
        agreement_hu: s, the difference in HU up to which slices agree, ≥ 0; 0 leaves each slice on its own.
        reach: Neighbours on each side, at least 1; slices half a detector row apart want two.

    Raises:
        ValueError: If `agreement_hu` is negative or not finite, or `reach` below 1.

    References:
        Tomasi and Manduchi, ICCV (1998) 839, for weights that fall with the difference.

    Example:
        >>> from pnpct.denoisers import Gaussian
        >>> AcrossSlices(Gaussian(1.0))(torch.ones(5, 16, 16)).shape
        torch.Size([5, 16, 16])
    """

    denoise: Callable[[Image], Image]
    agreement_hu: float = 30.0
    reach: int = 1

    def __post_init__(self) -> None:
        if not 0 <= self.agreement_hu < math.inf:
            raise ValueError(f"Slices agree up to a difference in HU from 0 up, got {self.agreement_hu:g}.")
        if self.reach < 1:
            raise ValueError(f"There is at least one neighbour on each side, got a reach of {self.reach}.")

    @property
    def settings(self) -> dict[str, Any]:
        """All that its volumes depend on, as plain values."""
        return {**denoiser_settings(self.denoise), "slice_agreement_hu": self.agreement_hu, "slice_reach": self.reach}

    def __call__(self, volume: Volume | Image) -> Volume | Image:
        """Return the denoised volume; an image without an axis of slices is one slice."""
        denoised = self.denoise(volume)
        if self.agreement_hu == 0 or volume.ndim < 3 or volume.shape[-3] < 2:
            return denoised
        total, weight = denoised.clone(), torch.ones_like(denoised)
        for apart in range(1, min(self.reach, volume.shape[-3] - 1) + 1):
            upper, lower = denoised[..., apart:, :, :], denoised[..., :-apart, :, :]
            agree = _agreement(upper - lower, self.agreement_hu)
            total[..., :-apart, :, :].addcmul_(agree, upper)
            total[..., apart:, :, :].addcmul_(agree, lower)
            weight[..., :-apart, :, :] += agree
            weight[..., apart:, :, :] += agree
        return total / weight


def _agreement(difference: Volume, agreement_hu: float) -> Volume:
    """Return a of each pixel of two neighbouring slices, of which this is the difference."""
    squares = (difference * (1000 / agreement_hu)).square()
    slices = squares.reshape(-1, 1, *squares.shape[-2:])
    mean = functional.avg_pool2d(slices, _SIDE, stride=1, padding=_SIDE // 2, count_include_pad=False)
    return torch.exp(-mean.reshape(squares.shape) / 2)
