"""From the rays of a cone beam to those of fan beams in planes, which are nearly horizontal.

A plane of height h(x, y) takes, of each view and fan angle, the ray that meets it where the ray is nearest to the axis.
With l the distance from the focal spot to there and L to the detector, both seen along the axis, that ray ends on the
detector at the height

    v = z_spot + (h − z_spot) L/l

and the fan beam has its line integral times cos(rise), the length that it would have in the plane. Between the rows
it is interpolated, p = (1 − t) p₁ + t p₂, and its weight is the inverse variance of that, not an interpolated weight:

    w = 1 / ((1 − t)²/w₁ + t²/w₂).

References:
    Kachelriess, Schaller and Kalender, Med. Phys. 27 (2000) 754; Noo, Defrise and Clackdoyle, Phys. Med. Biol. 44
    (1999) 561.
"""

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from pnpct.geometry import ConeBeam, Plane
from pnpct.physics import DiagonalWeights, Sinogram


def rebin(sinogram: Sinogram, geometry: ConeBeam, planes: Sequence[Plane]) -> Sinogram:
    """Return what a fan beam would have measured in each of several planes.

    Rays beside the detector have the weight 0; their line integrals are those of the nearest row, which filtered
    back-projection needs in place of nothing.

    Args:
        sinogram: Line integrals and weights of the cone beam.
        geometry: Its views.
        planes: Any number; they become a dimension before views and bins.

    Returns:
        Line integrals and weights of the rays in the planes, as they are seen along the axis.

    Raises:
        ValueError: If no ray meets a row.
    """
    line_integrals, weights = rebinned(sinogram, geometry, planes)
    return Sinogram(line_integrals, DiagonalWeights(weights), sinogram.bone)


def rebinned(sinogram: Sinogram, geometry: ConeBeam, planes: Sequence[Plane]) -> tuple[Tensor, Tensor]:
    """Return line integrals and weights as `rebin` does: of views of which, perhaps, no ray meets a row."""
    spots = geometry.focal_spots()
    along = geometry.detector_points(geometry.fan_angles) - spots[:, None]
    distance = np.linalg.norm(along[..., :2], axis=-1)  # L
    nearest = -(along[..., :2] * spots[:, None, :2]).sum(-1) / distance  # l
    points = spots[:, None, :2] + along[..., :2] * (nearest / distance)[..., None]
    z_spot, detector = spots[:, None, 2], geometry.trajectory.heights[:, None]
    rows, bottom = geometry.rows, geometry.detector.row_positions[0]
    row_height = geometry.detector.row_height or 1.0
    parts = []
    for plane in planes:
        height = plane.heights(points[..., 0], points[..., 1])
        rise = (height - z_spot) * distance / nearest
        row = (z_spot + rise - detector - bottom) / row_height
        inside = (row >= -0.5) & (row <= rows - 0.5)
        lower = np.clip(np.floor(row), 0, max(rows - 2, 0)).astype(np.int64)
        share = np.clip(row - lower, 0.0, min(rows - 1, 1))
        shortening = 1 / np.sqrt(1 + (rise / distance) ** 2)
        parts.append(_between_rows(sinogram, *map(torch.from_numpy, (lower, share, inside, shortening))))
    line_integrals, weights = zip(*parts, strict=True)
    return torch.stack(line_integrals, dim=-3), torch.stack(weights, dim=-3)


def _between_rows(
    sinogram: Sinogram, lower: Tensor, share: Tensor, inside: Tensor, shortening: Tensor
) -> tuple[Tensor, Tensor]:
    values = sinogram.line_integrals
    t, shortening = share.to(values), shortening.to(values)
    lower = lower.to(values.device)
    upper = (lower + 1).clamp(max=values.shape[-2] - 1)
    weights = sinogram.weights.diagonal
    below, above = (_of_rows(values, row) for row in (lower, upper))
    w_below, w_above = (_of_rows(weights, row) for row in (lower, upper))
    zero = t.new_zeros(())
    variance = torch.where(t < 1, (1 - t) ** 2 / w_below, zero) + torch.where(t > 0, t**2 / w_above, zero)
    weight = torch.where(inside.to(t.device), 1 / (variance * shortening**2), zero)
    return torch.lerp(below, above, t) * shortening, weight


def _of_rows(values: Tensor, row: Tensor) -> Tensor:
    index = row[:, None, :].expand(*values.shape[:-3], *row[:, None, :].shape)
    return torch.gather(values, -2, index)[..., 0, :]
