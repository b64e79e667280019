"""The images that a denoiser learns from: those of FBP, and those that ADMM will show it."""

from functools import lru_cache

import numpy as np
import torch

from pnpct.arrays import Image
from pnpct.denoisers import TotalVariation
from pnpct.geometry import FanBeam, ImageGrid
from pnpct.operators import Projector
from pnpct.physics import Scan, take_log
from pnpct.reconstruction import ADMMState, fbp, pnp_admm

LOWEST_BETA, HIGHEST_BETA = 0.3, 3.0


def fbp_image(scan: Scan, grid: ImageGrid, _: torch.Generator) -> Image:
    """Return the sharpest image, with all its noise."""
    return fbp(take_log(scan).line_integrals, _projector(grid, scan.geometry, scan.mu_water), kernel="ram-lak")


def data_step_image(scan: Scan, grid: ImageGrid, generator: torch.Generator) -> Image:
    """Return what the denoiser gets in an early iteration of ADMM, whose noise has another colour than that of FBP.

    One data step from a smooth image of the same scan, β being drawn evenly in its logarithm from 0.3 to 3.
    """
    A = _projector(grid, scan.geometry, scan.mu_water)
    sinogram = take_log(scan)
    smooth = TotalVariation(0.05)(fbp(sinogram.line_integrals, A, kernel="soft"))
    share = float(torch.rand((), generator=generator))
    beta = float(np.exp((1 - share) * np.log(LOWEST_BETA) + share * np.log(HIGHEST_BETA)))
    return next(pnp_admm(sinogram, A, lambda image: image, ADMMState.start(smooth), beta=beta)).x


@lru_cache(maxsize=8)
def _projector(grid: ImageGrid, geometry: FanBeam, mu_water: float) -> Projector:
    """A projector takes longer to make than to use, and a data set has few."""
    return Projector(grid, geometry, mu_water=mu_water)
