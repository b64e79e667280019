"""Modules of the detector that measured nothing: their rays as those of a first image."""

from dataclasses import replace

import torch

from pnpct.denoisers import TotalVariation
from pnpct.operators import Projector
from pnpct.physics import Sinogram, fill_along_detector
from pnpct.reconstruction.first_image import first_image, projector_of_everything

WIDE = 3
"""Interpolated bins side by side behind which a first image knows more than a line between their neighbours."""

STEP = 1.7
"""Times the step towards what a first image shows. Lines that were measured once, from the opposite side, count half in
the image: a simple step halves their error, and this one leaves 15 % of it."""

IMAGES = 2
"""First images, one after the other."""

IMAGES_OF_NOTHING, STRENGTH = 4, 0.1
"""As many where lines were measured from neither side, and the strength of their total variation, image × pixel."""


def filled_from_image(sinogram: Sinogram, A: Projector) -> Sinogram:
    """Return a sinogram in which rays of dead modules are those of a first image; others stay as they are.

    A line between the ends of a module misses what lies behind it, such as a bone. The same lines were measured
    from the opposite side, unless the module reaches across the middle of the fan: so they are in the image of filtered
    back-projection, at half their height. Its projection, with the differences at the ends of the module, replaces the
    rays, and makes the next image. Where lines were measured from neither side, total variation smooths the image. It
    does nothing where fewer than three bins side by side are interpolated, and on a limited angle, which has no
    opposite side.

    Args:
        sinogram: Line integrals, and which of them were interpolated.
        A: The projector.
    """
    missing = sinogram.interpolated
    if missing is None or A.geometry.limited_angle:
        return sinogram
    missing = missing.expand(A.geometry.shape)
    if not bool(missing.unfold(-1, min(WIDE, A.geometry.bins), 1).all(-1).any()):
        return sinogram
    per_bin = missing.any(0)
    twice = bool((per_bin & per_bin.flip(0)).any())  # a detector's offset moves both sides by less than a module
    denoise = TotalVariation(STRENGTH) if twice else None
    wide = projector_of_everything(A)
    for _ in range(IMAGES_OF_NOTHING if twice else IMAGES):
        p = sinogram.line_integrals
        image = first_image(sinogram, wide, kernel="hann").clamp(min=0)
        shown = wide(denoise(image) if denoise else image)
        step = fill_along_detector(p - shown, ~missing) + shown - p
        sinogram = replace(sinogram, line_integrals=torch.where(missing, p + STEP * step, p))
    return sinogram
