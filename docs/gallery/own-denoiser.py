"""A denoiser of one's own, a median filter of SciPy: alone on FBP, and in the loop with the data."""

from pathlib import Path

import torch
from scipy.ndimage import median_filter

from pnpct.arrays import Image
from pnpct.operators import Projector
from pnpct.physics import take_log
from pnpct.reconstruction import FBP, PlugAndPlay
from pnpct.report import show
from pnpct.simulation import example_scan


def median(image: Image) -> Image:
    """Return the median of each pixel and its neighbours."""
    return torch.from_numpy(median_filter(image.numpy(), size=3, axes=(-2, -1)))


scan, truth, grid = example_scan("abdomen", tube_current_ma=20.0)
A, sinogram = Projector(grid, scan.geometry, mu_water=scan.mu_water), take_log(scan)
sharp = FBP("ram-lak")(sinogram, A).image
images = {"FBP": sharp, "median of FBP": median(sharp), "in the loop": PlugAndPlay(median)(sinogram, A), "truth": truth}
show(images, window=(40, 400)).savefig(Path(__file__).with_suffix(".png"), dpi=45)
