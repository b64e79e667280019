"""Modules of the detector that measured nothing in any view: their rays as those of a first image."""

from dataclasses import replace

import numpy as np
import torch

from pnpct.operators import Projector
from pnpct.physics import DiagonalWeights, Sinogram, fill_along_detector
from pnpct.reconstruction.first_image import first_image, projector_of_everything

WIDE = 3
"""Dead bins side by side that hide enough for a first image to know better than a line between their neighbours."""

IMAGES = 2
"""First images, one after the other."""

STEP = 1.7
"""Times the step towards what a first image shows. The lines of a dead module were measured once, from the opposite
side, and count half in the image: a simple step halves their error, and this one leaves 15 % of it."""


def filled_from_image(sinogram: Sinogram, A: Projector) -> Sinogram:
    """Return a sinogram in which rays of dead modules are those of a first image; others stay as they are.

    Between the ends of a module a line misses what lies behind it, such as a bone. The same lines were measured
    from the opposite side, unless the module is in the middle of the fan: so they are in the image of filtered
    back-projection, at half their height. Its projection, with the differences at the ends of the module, replaces the
    rays, and makes the next image. It does nothing where fewer than three bins side by side are dead, and on a limited
    angle, which has no opposite side.

    Args:
        sinogram: Line integrals, and weights that are 0 in rays that were not measured.
        A: The projector.
    """
    W = sinogram.weights
    if not isinstance(W, DiagonalWeights) or A.geometry.limited_angle:
        return sinogram
    dead = (W.diagonal == 0).reshape(-1, A.geometry.bins).all(0)
    if not _has_run(dead.cpu().numpy(), WIDE):
        return sinogram
    wide = projector_of_everything(A)
    for _ in range(IMAGES):
        p = sinogram.line_integrals
        shown = wide(first_image(sinogram, wide, kernel="hann").clamp(min=0))
        step = fill_along_detector(p - shown, ~dead) + shown - p
        sinogram = replace(sinogram, line_integrals=torch.where(dead, p + STEP * step, p))
    return sinogram


def _has_run(flags: np.ndarray, length: int) -> bool:
    return bool(np.convolve(flags.astype(int), np.ones(length, int)).max(initial=0) >= length)
