"""Small cone beams of every kind, and the volumes that they see."""

import math
from dataclasses import replace

from pnpct.geometry import ConeBeam, Detector, ImageGrid, Trajectory, VolumeGrid, evenly_spaced_views

DETECTOR = Detector(bins=45, bin_width=20.0, offset=0.25, rows=12, row_height=7.0)
CIRCLE = ConeBeam(Trajectory(evenly_spaced_views(24, start=0.02)), DETECTOR, 541.0, 949.0)
HELIX = replace(
    CIRCLE,
    trajectory=Trajectory(
        [angle + turn * 2 * math.pi for turn in range(2) for angle in evenly_spaced_views(17)],
        [-24.0 + 48.0 * view / 34 for view in range(34)],
    ),
)
MOVING = replace(
    HELIX,
    trajectory=replace(
        HELIX.trajectory, focal_spot_shifts=[(1.5 * (n % 2), 5.0 * (n % 2), -0.7 * (n % 2)) for n in range(34)]
    ),
)
PLANE = ImageGrid(28, 28, spacing=16.0)
GRID = VolumeGrid(PLANE, 14, 4.0)

WORLDS = {
    "circle": (CIRCLE, GRID),
    "helix": (HELIX, GRID),
    "moving focal spot": (MOVING, GRID),
    "flat, rows off the middle": (
        replace(CIRCLE, detector=replace(DETECTOR, kind="flat", offset=-2.3, row_offset=0.8)),
        GRID,
    ),
    "cells that share heights": (replace(HELIX, detector=replace(DETECTOR, bins=178, bin_width=5.0)), GRID),
    "flat, cells that share heights": (
        replace(CIRCLE, detector=replace(DETECTOR, bins=199, bin_width=5.0, kind="flat", row_offset=0.8)),
        VolumeGrid(ImageGrid(28, 28, spacing=15.0), 14, 4.0),
    ),
    "one row": (replace(CIRCLE, detector=replace(DETECTOR, rows=1)), VolumeGrid(PLANE, 3, 4.0)),
    "more rows than vectors": (replace(CIRCLE, detector=replace(DETECTOR, rows=80, row_height=1.5)), GRID),
    "many thin slices": (HELIX, VolumeGrid(PLANE, 100, 0.6, z=3.0)),
    "thick slices": (HELIX, VolumeGrid(PLANE, 3, 40.0)),
    "wide, off centre": (HELIX, VolumeGrid(ImageGrid(17, 29, spacing=12.0, center=(40.0, -25.0)), 14, 4.0, z=-11.0)),
    "zoomed": (HELIX, VolumeGrid(ImageGrid(28, 28, spacing=2.0), 14, 4.0)),
    "more parts of a cell than neighbours": (HELIX, VolumeGrid(ImageGrid(28, 28, spacing=1.0), 14, 4.0)),
    "coarse": (CIRCLE, VolumeGrid(ImageGrid(5, 6, spacing=70.0), 14, 4.0)),
    "beside the beam in part": (CIRCLE, VolumeGrid(PLANE, 14, 4.0, z=30.0)),
}
