"""Pixels of half the size, where the data say more than the pixels that were asked for can hold."""

from dataclasses import replace

from pnpct.denoisers import Denoise
from pnpct.denoisers.learned import DENSEST, LearnedDenoiser
from pnpct.reconstruction.fbp import fbp
from pnpct.reconstruction.normal_equations import balanced_sigma_v
from pnpct.reconstruction.starting import far_apart
from pnpct.reconstruction.whole_object import Whole

CERTAIN = 45.0
"""Standard deviation, HU, to which the data alone have to determine a pixel before it is divided.

With more noise a network takes that of small pixels, which is correlated from each to the next, for anatomy.
"""

LARGEST = 320**2
"""Pixels of the largest image whose pixels are divided; larger ones would take five times as long, and gain less."""

FINEST = 0.4
"""Smallest pixels over cells of the detector, at the isocentre; smaller ones were not tried."""


def on_finer_pixels(whole: Whole, denoise: Denoise) -> Whole:
    """Divide the pixels in four where that is better: large pixels, little noise, and a network that knows small ones.

    Pixels larger than the cells of the detector cannot hold what the rays have seen of edges, and most of the error of
    a good image is there; a network that has learnt from smaller pixels blurs fine detail too. The images are averaged
    again in the end. With metal, or fewer rays than pixels, all stays as it is: streaks would be sharper, and the
    network keep them; unless it is views that are few, where total variation takes the streaks away first.

    Args:
        whole: Rays, and the pixels that hold the object.
        denoise: The denoiser of plug-and-play; only learned ones that know their pixels can gain.
    """
    sinogram, A = whole.sinogram, whole.A
    finer = A.grid.halved
    known = isinstance(denoise, LearnedDenoiser) and denoise.finest_pixel and finer.spacing >= denoise.finest_pixel
    pixels, views, bins = A.grid.rows * A.grid.cols, *A.geometry.shape
    divided = A.on(finer)
    few_views = far_apart(divided)
    enough_rays = (views * bins >= pixels or few_views) and not A.geometry.limited_angle
    if not known or not enough_rays or pixels > LARGEST or finer.spacing < FINEST * A.geometry.bin_width_at_isocenter:
        return whole
    certain = (2 if few_views else 1) * CERTAIN  # total variation has taken most of the noise too
    noisy = bool((balanced_sigma_v(sinogram, A) > certain).any())
    if noisy or bool((fbp(sinogram.line_integrals, A) > DENSEST).any()):
        return whole
    note = f"Reconstructed on pixels of {finer.spacing:.4g} mm, and averaged to those that were asked for."
    return replace(whole, A=divided, notes=(*whole.notes, note))
