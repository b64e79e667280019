"""The same scan at half the resolution, where an iteration costs an eighth."""

import math
from dataclasses import replace
from typing import TypeAlias

import numpy as np
import torch
from jaxtyping import Float
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from pnpct.arrays import Image
from pnpct.geometry import FanBeam, ImageGrid, Trajectory
from pnpct.operators import AnyProjector, ConeProjector, Projector
from pnpct.operators.cone.cone_lines import seen_along_the_axis
from pnpct.physics import DiagonalWeights, Sinogram

CoarseImage: TypeAlias = Float[Tensor, "*batch coarse_rows coarse_cols"]
"""An image of half as many rows and columns."""

NEAR = math.radians(0.6)
"""Neighbouring views that are farther apart are not combined."""


def at_half_resolution(sinogram: Sinogram, A: AnyProjector) -> tuple[Sinogram, AnyProjector]:
    """Return line integrals and weights of neighbouring cells and views in pairs, and a projector of pixels in fours.

    The line integral of a pair is the weighted mean, its weight the sum. Views stay as they are where neighbours are
    more than `NEAR` apart, or the focal spot moves between them; detector rows and slices always do. Correlations of
    the noise are left out.

    Args:
        sinogram: Line integrals and weights.
        A: The projector, of a cone beam that of an axial scan.
    """
    if isinstance(A, ConeProjector):
        return _of_cone(sinogram, A)
    return _of_fan(sinogram, A)


def halved(image: Image) -> CoarseImage:
    """Return the means over squares of two by two pixels; at an odd border those outside repeat the last ones."""
    rows, cols = image.shape[-2:]
    slices = functional.pad(image.reshape(-1, 1, rows, cols), (0, cols % 2, 0, rows % 2), mode="replicate")
    pooled = functional.avg_pool2d(slices, 2)
    return pooled.reshape(*image.shape[:-2], *pooled.shape[-2:])


def doubled(image: CoarseImage, shape: tuple[int, int]) -> Image:
    """Return an image of `shape` pixels, interpolated linearly between those of its `halved` image."""
    slices = image.reshape(-1, 1, *image.shape[-2:])
    fine = functional.interpolate(slices, scale_factor=2, mode="bilinear", align_corners=False)
    return fine[..., : shape[0], : shape[1]].reshape(*image.shape[:-2], *shape)


def coarser_grid(grid: ImageGrid) -> ImageGrid:
    """Return the pixels of the `halved` image: twice the spacing; an odd border grows by one to the right or below."""
    rows, cols, (x, y) = grid.rows + grid.rows % 2, grid.cols + grid.cols % 2, grid.center
    center = (x + grid.cols % 2 * grid.spacing / 2, y - grid.rows % 2 * grid.spacing / 2)
    return ImageGrid(rows // 2, cols // 2, 2 * grid.spacing, center)


def _of_fan(sinogram: Sinogram, A: Projector) -> tuple[Sinogram, Projector]:
    geometry, views = _paired(A.geometry)
    y = _extended(sinogram.line_integrals, views)
    w = _extended(sinogram.weights.diagonal, views)
    if A.geometry.bins % 2:
        w[..., -1] = 0.0  # the cell that was added
    if A.geometry.views % 2:
        w[..., -1, 1:, :] = 0.0  # the last view was its own partner
    weights = _sums(w, geometry.shape)
    mean = _sums(w * y, geometry.shape) / weights.clamp(min=torch.finfo(w.dtype).tiny)
    support = None if A.support is None else halved(A.support.float()) > 0
    coarse = Projector(coarser_grid(A.grid), geometry, mu_water=A.mu_water, method=A.method, support=support)
    return Sinogram(mean, DiagonalWeights(weights, geometry.shape)), coarse


def _of_cone(sinogram: Sinogram, A: ConeProjector) -> tuple[Sinogram, ConeProjector]:
    """Each row is a fan beam, seen along the axis."""
    geometry, trajectory = A.geometry, A.geometry.trajectory
    y, w = (rays.transpose(-3, -2) for rays in (sinogram.line_integrals, sinogram.weights.diagonal))
    fan = Projector(A.grid.plane, seen_along_the_axis(geometry), mu_water=A.mu_water, support=A.support)
    of_rows, coarse = _of_fan(Sinogram(y, DiagonalWeights(w)), fan)
    seen = coarse.geometry
    detector = replace(geometry.detector, bins=seen.bins, bin_width=seen.bin_width, offset=seen.detector_offset)
    if seen.views < geometry.views:
        trajectory = Trajectory(seen.view_angles, trajectory.heights[::2])
    paired = replace(geometry, trajectory=trajectory, detector=detector)
    mean, weights = (rays.transpose(-3, -2) for rays in (of_rows.line_integrals, of_rows.weights.diagonal))
    grid = replace(A.grid, plane=coarse.grid)
    cone = ConeProjector(grid, paired, mu_water=A.mu_water, support=coarse.support)
    return Sinogram(mean, DiagonalWeights(weights, paired.shape)), cone


def _paired(geometry: FanBeam) -> tuple[FanBeam, NDArray[np.int64]]:
    """The geometry of the pairs, and the views that make them: (pairs, 1 or 2); a last one alone is its own partner."""
    odd = geometry.bins % 2
    offset = (geometry.detector_offset + odd / 2) / 2
    paired = replace(geometry, bins=geometry.bins // 2 + odd, bin_width=2 * geometry.bin_width, detector_offset=offset)
    first = np.arange(0, geometry.views, 2)
    pairs = np.stack([first, np.minimum(first + 1, geometry.views - 1)], axis=1)
    angles = np.array(geometry.view_angles)[pairs]
    if np.ptp(angles, axis=1).max() > NEAR or geometry.focal_spot_shifts:
        return paired, np.arange(geometry.views)[:, None]
    return replace(paired, view_angles=angles.mean(1)), pairs


def _extended(rays: Tensor, views: NDArray[np.int64]) -> Tensor:
    """The rays as (*batch, pairs, views of a pair, bins), the number of bins made even."""
    rays = rays[..., torch.from_numpy(views).to(rays.device), :]
    return functional.pad(rays, (0, rays.shape[-1] % 2))


def _sums(rays: Tensor, shape: tuple[int, int]) -> Tensor:
    answer: Tensor = rays.unflatten(-1, (shape[1], 2)).sum((-3, -1))
    return answer
