"""Beam hardening by bone: a first image tells where bone is, and the line integrals get what they lack."""

from dataclasses import replace

from pnpct.arrays import Image, Volume
from pnpct.denoisers import Gaussian
from pnpct.operators import AnyProjector, Projector
from pnpct.physics import DiagonalWeights, Sinogram
from pnpct.reconstruction.first_image import first_image, projector_of_everything

BLUR = 2.0
"""Standard deviation of the blur before bone is found, pixels: noise is not bone."""


def corrected_for_bone(sinogram: Sinogram, A: Projector) -> Sinogram:
    """Return line integrals, and their weights, as of a beam that bone does not harden more than water does.

    Without it the brain is too bright along the skull, and there are dark bands between dense bones. It takes one
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
    """Return line integrals, and their weights, with what they lack behind the bone of a first image.

    Args:
        image: The first image.
        sinogram: Line integrals, corrected for water, and weights.
        A: The projector of the image.
    """
    bone, p, W = sinogram.bone, sinogram.line_integrals, sinogram.weights
    if bone is None:
        return sinogram
    q = A(bone.in_image(image, Gaussian(BLUR)(image)))
    if isinstance(W, DiagonalWeights):
        W = DiagonalWeights(W.diagonal / (1 + bone.slope(p, q)).square(), W.range_shape)
    return replace(sinogram, line_integrals=p + bone.lacking(p, q), weights=W, bone=None)
