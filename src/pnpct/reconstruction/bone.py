"""Beam hardening by tissues that are not water: a first image tells what they are, and the rays get what they lack."""

from dataclasses import replace

import torch

from pnpct.arrays import Image, Volume
from pnpct.denoisers import Gaussian
from pnpct.operators import AnyProjector, Projector
from pnpct.physics import DiagonalWeights, Sinogram
from pnpct.physics.bone_hardening import soft_tissue
from pnpct.reconstruction.first_image import first_image, projector_of_everything

BLUR = 2.0
"""Standard deviation of the blur before bone is found, pixels: noise is not bone."""

AROUND = 3.0
"""The same of the mean over soft tissue around a pixel: tens of HU matter there, and noise has hundreds."""


def corrected_for_bone(sinogram: Sinogram, A: Projector) -> Sinogram:
    """Return line integrals, and their weights, as of a beam that no tissue hardens more, or less, than water does.

    Without it the brain is too bright along the skull, there are dark bands between dense bones, and organs of a large
    patient are too dark by several HU behind what has contrast medium, and fat too bright. It takes one
    filtered back-projection and one projection. It does nothing where the spectrum of the scan is not known, and on a
    limited angle, where the first image has streaks that look like bone.

    Args:
        sinogram: Line integrals, corrected for water, and weights.
        A: The projector. Bone is looked for over all that the fan covers, whatever its grid is.

    References:
        Joseph and Spital, J. Comput. Assist. Tomogr. 2 (1978) 100.
    """
    if sinogram.bone is None:
        return sinogram
    if A.geometry.limited_angle:
        return replace(sinogram, bone=None)
    wide = projector_of_everything(A)
    return with_bone_of(first_image(sinogram, wide, kernel="soft"), sinogram, wide)


def with_bone_of(image: Image | Volume, sinogram: Sinogram, A: AnyProjector) -> Sinogram:
    """Return line integrals, and their weights, with what they lack behind the tissues of a first image.

    Args:
        image: The first image.
        sinogram: Line integrals, corrected for water, and weights.
        A: The projector of the image.
    """
    bone, p, W = sinogram.bone, sinogram.line_integrals, sinogram.weights
    if bone is None:
        return sinogram
    seen, blur = Gaussian(BLUR)(image), Gaussian(AROUND)
    soft = soft_tissue(seen)
    around = blur(soft * image) / blur(soft).clamp(min=torch.finfo(soft.dtype).eps)
    q = A(bone.in_image(image, seen, around))
    if isinstance(W, DiagonalWeights):
        W = DiagonalWeights(W.diagonal / (1 + bone.slope(p, q)).square(), W.range_shape)
    return replace(sinogram, line_integrals=p + bone.lacking(p, q), weights=W, bone=None)
