"""The kernels of filtered back-projection, from sharp to smooth: resolution is paid for with noise."""

from pathlib import Path

from pnpct.operators import Projector
from pnpct.physics import take_log
from pnpct.reconstruction import FBP
from pnpct.report import show
from pnpct.simulation import example_scan

scan, _, grid = example_scan("abdomen")
A, sinogram = Projector(grid, scan.geometry, mu_water=scan.mu_water), take_log(scan)
images = {kernel: FBP(kernel)(sinogram, A) for kernel in ("ram-lak", "shepp-logan", "hann", "soft")}
show(images, window=(40, 400)).savefig(Path(__file__).with_suffix(".png"), dpi=45)
