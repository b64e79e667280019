"""Denoisers: plain callables from image to image, with their strength bound inside."""

from pnpct.denoisers.by_name import DENOISERS, Classical, Denoise, make_denoiser
from pnpct.denoisers.gaussian import Gaussian
from pnpct.denoisers.learned import LearnedDenoiser
from pnpct.denoisers.network_cost import network_cost
from pnpct.denoisers.nonlocal_means import NonlocalMeans
from pnpct.denoisers.rdn_cbam import RDNCBAM, SIZES, RDNSize
from pnpct.denoisers.red_cnn import REDCNN
from pnpct.denoisers.total_variation import TotalVariation, total_variation

__all__ = [
    "DENOISERS",
    "RDNCBAM",
    "REDCNN",
    "SIZES",
    "Classical",
    "Denoise",
    "Gaussian",
    "LearnedDenoiser",
    "NonlocalMeans",
    "RDNSize",
    "TotalVariation",
    "make_denoiser",
    "network_cost",
    "total_variation",
]
