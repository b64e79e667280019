"""Exact line integrals of ellipsoids of water, along the rays of a cone beam."""

import numpy as np
import torch

from pnpct.geometry import ConeBeam

MU_WATER = 0.02


def chords(cone: ConeBeam, *ellipsoids: tuple) -> torch.Tensor:
    """Exact line integrals of ellipsoids: centre, half axes, attenuation relative to water."""
    spots = cone.focal_spots()[:, None, None]
    cells = np.repeat(cone.detector_points(cone.fan_angles)[:, None], cone.rows, axis=1)
    cells[..., 2] += cone.detector.row_positions[:, None]
    along = (cells - spots) / np.linalg.norm(cells - spots, axis=-1, keepdims=True)
    total = np.zeros(cone.shape)
    for center, axes, attenuation in ellipsoids:
        from_center, towards = (spots - center) / axes, along / axes
        a, b, c = (towards**2).sum(-1), (from_center * towards).sum(-1), (from_center**2).sum(-1) - 1
        total += MU_WATER * attenuation * 2 * np.sqrt(np.maximum(b**2 - a * c, 0)) / a
    return torch.from_numpy(total).float()
