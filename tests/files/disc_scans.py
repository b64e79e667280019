"""A scan of three discs, whose line integrals are exact."""

import math

import numpy as np

MU = 0.0192587
BINS, VIEWS = 256, 180
GEOMETRY = {"source_to_isocenter_mm": 570, "source_to_detector_mm": 1040, "bins": BINS, "bin_width_mm": 2.4}
GEOMETRY |= {"views": VIEWS}
BODY = ((0.0, 0.0, 110.0, 1.0), (60.0, 0.0, 14.0, 0.8), (-50.0, -10.0, 16.0, -0.09))  # water, +800 HU, -90 HU
RIGHT = [0, 800, -90]


def chords():
    """Exact chords of three discs."""
    b = 2 * math.pi * np.arange(VIEWS)[:, None] / VIEWS
    g = (np.arange(BINS) - (BINS - 1) / 2) * 2 * math.atan(1.2 / 1040)
    along = np.sin(b + g), -np.cos(b + g)
    p = np.zeros((VIEWS, BINS))
    for x, y, radius, relative in BODY:
        off = (x + 570 * np.sin(b)) * along[1] - (y - 570 * np.cos(b)) * along[0]
        p += relative * MU * 2 * np.sqrt(np.maximum(radius**2 - off**2, 0))
    return p
