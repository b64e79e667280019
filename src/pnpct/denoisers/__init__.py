"""Denoisers: plain callables from image to image, with their strength bound inside."""

from pnpct.denoisers.by_name import DENOISERS, Denoise, make_denoiser
from pnpct.denoisers.gaussian import Gaussian
from pnpct.denoisers.nonlocal_means import NonlocalMeans
from pnpct.denoisers.total_variation import TotalVariation, total_variation

__all__ = [
    "DENOISERS",
    "Denoise",
    "Gaussian",
    "NonlocalMeans",
    "TotalVariation",
    "make_denoiser",
    "total_variation",
]
