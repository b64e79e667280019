"""Denoisers: plain callables from image to image, with their strength bound inside."""

from pnpct.denoisers.across_slices import AcrossSlices
from pnpct.denoisers.adapted import AdaptedNetwork
from pnpct.denoisers.by_name import DENOISERS, Classical, Denoise, make_denoiser
from pnpct.denoisers.gaussian import Gaussian
from pnpct.denoisers.learned import LearnedDenoiser
from pnpct.denoisers.network_cost import network_cost
from pnpct.denoisers.noise_level import estimated_noise
from pnpct.denoisers.nonlocal_means import NonlocalMeans
from pnpct.denoisers.rdn_cbam import RDNCBAM, SIZES, RDNSize
from pnpct.denoisers.red_cnn import REDCNN
from pnpct.denoisers.settings import denoiser_settings
from pnpct.denoisers.total_variation import TotalVariation, total_variation

__all__ = [
    "DENOISERS",
    "RDNCBAM",
    "REDCNN",
    "SIZES",
    "AcrossSlices",
    "AdaptedNetwork",
    "Classical",
    "Denoise",
    "Gaussian",
    "LearnedDenoiser",
    "NonlocalMeans",
    "RDNSize",
    "TotalVariation",
    "denoiser_settings",
    "estimated_noise",
    "make_denoiser",
    "network_cost",
    "total_variation",
]
