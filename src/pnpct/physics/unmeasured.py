"""Rays that were not measured: dead cells, masked cells, views with a fault."""

from collections.abc import Iterable

import numpy as np
import scipy
import torch
from jaxtyping import Bool
from numpy.typing import NDArray
from torch import Tensor

from pnpct.arrays import ConeRays, Rays
from pnpct.physics.scan import Scan

_AROUND = 5
_CELLS_AROUND = (17, 65, 129)
"""The cells that one is compared with, of which most are good: a module of the detector has up to 64."""

_NO_SPREAD = 1e-5
"""Of line integrals: no noise is as small."""

_MANY = 100.0
"""Counts of the rays around one that has none: by chance it has none in 1 of 10⁴³ cases, and metal has an edge."""


def fill_along_detector(rays: Rays | ConeRays, measured: Bool[Tensor, "..."]) -> Rays | ConeRays:
    """Replace rays that were not measured by what lies between their nearest measured neighbours in the same row.

    Linear in the number of the bin; beyond the outermost measured ray its value stays.

    Args:
        rays: Values of each ray, any where not measured.
        measured: Whether each ray was measured; broadcasts to the rays.

    Raises:
        ValueError: If a row was not measured at all.

    Example:
        >>> fill_along_detector(torch.tensor([[1.0, 9.0, 3.0]]), torch.tensor([True, False, True])).tolist()
        [[1.0, 2.0, 3.0]]
    """
    flat = rays.detach().cpu().double().reshape(-1, rays.shape[-1]).numpy().copy()
    known = measured.cpu().expand(rays.shape).reshape(-1, rays.shape[-1]).numpy()
    bins = np.arange(rays.shape[-1])
    if not known.any(axis=1).all():
        raise ValueError("Some views were not measured at all; leave them out of the scan, as in scan[views].")
    for row in np.flatnonzero(~known.all(axis=1)):
        good = known[row]
        flat[row, ~good] = np.interp(bins[~good], bins[good], flat[row, good])
    return torch.from_numpy(flat).reshape(rays.shape).to(rays)


def dead_cells(total: NDArray[np.float64], rays: NDArray[np.integer], electronic_noise: float) -> NDArray[np.intp]:
    """Return the numbers of the cells, or of the views, that counted nothing but electronic noise.

    Their mean count is below three standard errors of that noise.

    Args:
        total: What each cell counted in all its measured rays, quanta.
        rays: How many these are; cells without any are not named.
        electronic_noise: Standard deviation of the electronic noise of a count, quanta.

    Example:
        >>> dead_cells(np.array([17.0, 0.0, 0.0, 9.0]), np.array([4, 4, 0, 4]), electronic_noise=2.0).tolist()
        [1, 3]
    """
    return np.flatnonzero((rays > 0) & (total <= 3 * electronic_noise * np.sqrt(rays)))


def unmeasured_and_dead(parts: Iterable[Scan]) -> tuple[int, NDArray[np.intp]]:
    """Return how many rays of a scan were not measured, and the numbers of its bins that are dead in all views.

    Args:
        parts: The scan, a few views after others.
    """
    missing, total, rays, noise = 0, np.zeros(1), np.zeros(1, np.int64), 0.0
    for part in parts:
        measured, noise = part.measured.expand(part.geometry.shape), part.electronic_noise
        missing += int((~measured).sum())
        used = measured.expand(part.counts.shape).reshape(-1, part.geometry.bins)
        total = total + part.counts.reshape(used.shape).where(used, 0.0).double().sum(0).numpy()
        rays = rays + used.sum(0).numpy()
    return missing, dead_cells(total, rays, noise)


def stuck_cells(line_integrals: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the numbers of the cells that read nearly one value in all views, unlike the cells around them.

    Their spread over the views is below a tenth of the median spread of the 17, 65 or 129 cells around, and their
    median is off that of these by more than 1; or they have no spread at all where air has noise. Air, which is the
    same in all views too, has mostly air around.

    Args:
        line_integrals: p, (..., views, bins), NaN where not measured; each bin is measured in some view.

    Example:
        >>> p = np.tile(np.linspace(3.0, 4.0, 20)[:, None], 40)
        >>> p[:, 30] = 0.5
        >>> stuck_cells(p).tolist()
        [30]
    """
    p = line_integrals.reshape(-1, line_integrals.shape[-1])
    stuck = np.zeros(p.shape[1], np.bool_)
    if min(p.shape) < _CELLS_AROUND[0]:
        return np.flatnonzero(stuck)
    spread, level = np.nanstd(p, axis=0), np.nanmedian(p, axis=0)
    constant = spread < _NO_SPREAD
    if spread[[0, -1]].min() < _NO_SPREAD:  # air without noise: then much of a round body is as constant
        constant[:] = False
    for cells in _CELLS_AROUND:
        if cells <= p.shape[1]:
            spread_around, level_around = (
                scipy.ndimage.median_filter(each, cells, mode="nearest") for each in (spread, level)
            )
            stuck |= (spread < 0.1 * spread_around) & (constant | (np.abs(level - level_around) > 1))
    return np.flatnonzero(stuck)


def lost_readings(counts: NDArray[np.float64], electronic_noise: float) -> NDArray[np.bool_]:
    """Return which rays counted nothing but electronic noise, though rays around counted 100 or more.

    Around one are most of the 5 × 5, or in its view the first rays on both sides that counted something, if there are
    any: of a module that failed for a while. Behind metal counts fall from ray to ray.

    Args:
        counts: Counts, (..., views, bins), quanta.
        electronic_noise: Standard deviation of the electronic noise of a count, quanta.

    Example:
        >>> counts = np.full((5, 6), 1000.0)
        >>> counts[2, 3] = 0.0
        >>> np.argwhere(lost_readings(counts, electronic_noise=2.0)).tolist()
        [[2, 3]]
    """
    nothing = 3 * electronic_noise
    lost = np.abs(counts) <= nothing  # what is far below 0 is another mistake
    if lost.any():
        window, many = (1,) * (counts.ndim - 2) + (_AROUND, _AROUND), max(_MANY, 10 * nothing)
        lost &= scipy.ndimage.median_filter(counts, window, mode="nearest") >= many
        low = np.abs(counts) <= 2 * nothing  # a module has thousands of rays, some of them with much noise
        before = _last_that_counts(counts, low)
        after = _last_that_counts(counts[..., ::-1], low[..., ::-1])[..., ::-1]
        least = np.minimum(before, after)
        lost |= low & (least >= many) & (least < np.inf)
    return lost


def _last_that_counts(counts: NDArray[np.float64], nothing: NDArray[np.bool_]) -> NDArray[np.float64]:
    """For each ray the count of the last one up to it that counted something; infinity before the first of these."""
    number = np.where(nothing, -1, np.arange(counts.shape[-1]))
    last = np.maximum.accumulate(number, axis=-1)
    return np.where(last < 0, np.inf, np.take_along_axis(counts, last.clip(0), axis=-1))
