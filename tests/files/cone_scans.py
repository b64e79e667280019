"""A small helix, the scan that it makes of a cylinder of water, and rays that cannot be had."""

import math
import os
import signal
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from pnpct.geometry import ConeBeam, Detector, Trajectory
from pnpct.physics import Scan, Sinogram

ANGLES = 2 * math.pi / 64 * np.arange(160)
HELIX = ConeBeam(
    Trajectory(ANGLES, z=20 * ANGLES / 2 / math.pi),
    Detector(bins=40, bin_width=15.0, rows=12, row_height=2.4),
    source_to_isocenter=541.0,
    source_to_detector=949.0,
)


def scan_of_water(geometry: ConeBeam) -> Scan:
    """A cylinder of water, 80 mm in radius, 30 mm aside."""
    spots = geometry.focal_spots()[:, None, :2]
    along = geometry.detector_points(geometry.fan_angles)[..., :2] - spots
    apart = np.array([30.0, 0.0]) - spots
    aside = (apart[..., 0] * along[..., 1] - apart[..., 1] * along[..., 0]) / np.linalg.norm(along, axis=-1)
    chords = 2 * np.sqrt(np.maximum(80.0**2 - aside**2, 0))
    counts = 1e5 * np.exp(-0.02 * np.repeat(chords[:, None], geometry.rows, axis=1))
    return Scan(torch.from_numpy(counts).float(), torch.tensor(1e5), 3.0, geometry, mu_water=0.02)


@dataclass(frozen=True)
class EndsItsWorker:
    """Rays that end the process that asks for them first, as a machine that fails does."""

    rays: Callable[[Sequence[int]], Sinogram]
    ended: Path

    def __call__(self, views: Sequence[int]) -> Sinogram:
        try:
            self.ended.touch(exist_ok=False)
        except FileExistsError:
            return self.rays(views)
        os.kill(os.getpid(), signal.SIGKILL)
        raise AssertionError("nothing outlives that")
