"""Total variation in the loop: TV-PWLS, and where plug-and-play begins."""

import math
from collections.abc import Iterator
from itertools import islice

import numpy as np
import torch
from torch.nn import functional

from pnpct.arrays import Image, Volume
from pnpct.denoisers import Denoise, TotalVariation
from pnpct.denoisers.learned import DENSEST
from pnpct.operators import AnyProjector, ConeProjector, Projector
from pnpct.operators.support import supported
from pnpct.physics import Sinogram
from pnpct.reconstruction.fbp import fbp
from pnpct.reconstruction.fdk import circle_volume
from pnpct.reconstruction.half_resolution import at_half_resolution, doubled, halved
from pnpct.reconstruction.normal_equations import balanced_sigma_v
from pnpct.reconstruction.pnp_admm import SIGMA_V, ADMMState, pnp_admm

STRENGTH = 1.5
"""Strength of total variation over the noise, pixels: at every dose near that of the least error."""

IN_SPACE = 0.4
"""Of that strength in space, where pixels have neighbours in three directions."""

FIRST_ITERATIONS = 4
"""Iterations around total variation, at half the resolution, before a network sees an image."""

FROM_NOTHING = 20
"""As many on a limited angle, where they begin from nothing."""

SHARE = 0.6
"""Of the image around total variation in soft tissue, where plug-and-play begins."""

BONE = (1.1, 1.3)
"""From where to where the share falls to nothing, relative to water: 100 to 300 HU."""

TOLERANCE = 1e-3
"""Of the proximal map, image: 1 HU."""

FIRST_TOLERANCE = 3e-3
"""The same at half the resolution: noise hides what is left."""

FAR_APART = 7.0
"""Pixels between neighbouring views at the border of the field of view, beyond which FBP has too many streaks to begin
with. Clinical scanners have 2 to 4."""

ITERATIONS_BETWEEN_VIEWS = 12
"""Iterations around total variation, at full resolution, where views are that far apart."""

ITERATIONS_AT_METAL, STRENGTH_AT_METAL = 5, 0.15
"""Iterations around total variation where there is metal, and its strength, image × pixel, whatever the dose is."""


def smooth_state(sinogram: Sinogram, A: AnyProjector, smooth: Image | Volume | None = None) -> ADMMState:
    """Return the state that begins from a smooth FBP image, made if None, or from nothing on a limited angle.

    There FBP has streaks in directions that no view has seen, and so no data take them away again. FBP of a cone beam
    is that of Feldkamp, Davis and Kress.
    """
    if smooth is not None:
        image = smooth
    elif isinstance(A, ConeProjector):
        image, _ = circle_volume(sinogram, A, "soft")
    else:
        image = fbp(sinogram.line_integrals, A, kernel="soft")
    image = supported(image, A.support)
    return ADMMState.start(torch.zeros_like(image) if A.geometry.limited_angle else image)


def starting_state(sinogram: Sinogram, A: AnyProjector, smooth: Image | Volume | None = None) -> ADMMState:
    """Return the state to begin from: a smooth FBP image, put right by total variation at half the resolution.

    Where hardly a photon arrives, behind metal or in the middle of a large patient, FBP has streaks and shading. The
    data say too little there to take them away again quickly, and networks take them for anatomy. They are coarse, so
    that the weighted data and total variation correct them at half the resolution, at an eighth of the cost. Total
    variation removes faint detail too; in a mixture of both images the network finds either. Bones stand out of the
    noise, and total variation would lower them: they are those of FBP. Streaks of metal are too strong for all that,
    and no matter of noise: there it is total variation alone, and more of it. Where the views are `FAR_APART`, FBP has
    streaks everywhere, which networks keep: there it is total variation alone too, of all rays.

    Args:
        sinogram: Line integrals and weights.
        A: The projector, of a cone beam that of an axial scan.
        smooth: The smooth FBP image, if it is there already.
    """
    first = smooth_state(sinogram, A, smooth)
    coarse = ADMMState.start(halved(first.v))
    half = at_half_resolution(sinogram, A)
    # A pixel of four has 8 times the certainty of one, and edges count half as many pixels.
    states = around_total_variation(*half, coarse, strength=STRENGTH / 2**0.5, tolerance=FIRST_TOLERANCE)
    piecewise = _after(FROM_NOTHING if A.geometry.limited_angle else FIRST_ITERATIONS, states)
    missing = doubled(piecewise - coarse.v, A.grid.shape[-2:])
    metal = (piecewise > DENSEST).any(dim=A.domain_dims, keepdim=True)
    piecewise = doubled(piecewise, A.grid.shape[-2:])
    if A.geometry.limited_angle:
        return ADMMState.start(piecewise)
    elsewhere = 1 - _near_bone(piecewise)
    start = torch.lerp(first.v + elsewhere * missing, piecewise, SHARE * elsewhere)
    if bool(metal.any()):
        sigma_v = balanced_sigma_v(sinogram, A, first.v)
        states = pnp_admm(sinogram, A, TotalVariation(STRENGTH_AT_METAL), first, sigma_v=sigma_v)
        start = torch.where(metal, _after(ITERATIONS_AT_METAL, states), start)
    elif far_apart(A):
        states = around_total_variation(sinogram, A, first, strength=STRENGTH)
        start = _after(ITERATIONS_BETWEEN_VIEWS, states)
    return ADMMState.start(start)


def far_apart(A: AnyProjector) -> bool:
    """Return whether there are so many pixels between neighbouring views that FBP has more streaks than anatomy.

    Views may come in any order, and in several turns. A cone beam has thousands of views.
    """
    if not isinstance(A, Projector):
        return False
    step = min(float(np.ptp(A.geometry.view_angles)), 2 * math.pi) / max(A.geometry.views - 1, 1)
    return step * A.geometry.field_of_view_radius > FAR_APART * A.grid.spacing


def around_total_variation(
    sinogram: Sinogram,
    A: AnyProjector,
    start: ADMMState,
    *,
    strength: float,
    across: float | None = None,
    tolerance: float = TOLERANCE,
) -> Iterator[ADMMState]:
    """Yield the iterates whose limit has the least ½ ‖A x − y‖²_W + λ · TV(x), λ = strength / σ, for ever.

    σ is the standard deviation to which the data alone determine a pixel, `balanced_sigma_v`.

    The limit does not depend on the penalty of ADMM, so that is the one that is fastest for each image: in balance with
    the data, unless they are so noisy that the proximal map would take longest.

    Args:
        sinogram: Line integrals and weights.
        A: The projector.
        start: The state to begin from.
        strength: Pixels, ≥ 0.
        across: Weight of differences between slices in TV, as of `TotalVariation`. None leaves each slice on its own;
            of a cone beam it is total variation in space, with `IN_SPACE` of the strength.
        tolerance: Of the proximal map, image.
    """
    if across is None and isinstance(A, ConeProjector):
        across, strength = A.grid.plane.spacing / A.grid.slice_spacing, IN_SPACE * strength
    across = across or 0.0
    from_nothing = isinstance(A, Projector) and A.geometry.limited_angle
    noise = balanced_sigma_v(sinogram, A, None if from_nothing else start.v)
    if across and isinstance(A, Projector) and noise.ndim > 2:  # the proximal map of a volume has one strength
        noise = noise.mean(-3, keepdim=True).expand_as(noise)
    sigma_v = noise.clamp(max=2 * SIGMA_V)
    # λ σ_v² = strength · q: and the proximal map of an image with that is q times the one of image/q with the strength.
    q = sigma_v.square() / noise / 1000
    denoise = TotalVariation(strength, tolerance=tolerance / float(q.max()), across=across)
    return pnp_admm(sinogram, A, possible(lambda image: q * denoise(image / q), A), start, sigma_v=sigma_v)


def possible(denoise: Denoise, A: AnyProjector) -> Denoise:
    """Return a denoiser without negative attenuation where the angle is limited; elsewhere the same denoiser.

    The data exclude negative values by themselves, unless directions are missing: then an image that fits has them
    beside too large ones, along the rays. After the proximal map of total variation, this is that of total variation
    over images that are nowhere negative.

    References:
        Chambolle, EMMCVPR (2005) 136: the level sets of the proximal map of total variation are minimisers each.
    """
    return (lambda image: denoise(image).clamp(min=0)) if A.geometry.limited_angle else denoise


def _near_bone(image: Image) -> Image:
    """1 at bones and two pixels around them, 0 elsewhere; it rises with the density of bone."""
    low, high = BONE
    bone = ((image - low) / (high - low)).clamp(0, 1)
    slices = bone.reshape(-1, 1, *bone.shape[-2:])
    return functional.max_pool2d(slices, 5, stride=1, padding=2).reshape(image.shape)


def _after(number: int, states: Iterator[ADMMState]) -> Image:
    return next(islice(states, number - 1, None)).v
