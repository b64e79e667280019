"""A scan of 62 views: streaks by FBP, and what weighted least squares with total variation makes of it."""

from pathlib import Path

from pnpct.operators import Projector
from pnpct.physics import take_log
from pnpct.reconstruction import FBP, TVPWLS
from pnpct.report import show
from pnpct.simulation import example_scan

scan, truth, grid = example_scan("head", tube_current_ma=100.0)
few = scan[::8]
A, sinogram = Projector(grid, few.geometry, mu_water=few.mu_water), take_log(few)
images = {"FBP": FBP("soft")(sinogram, A), "total variation": TVPWLS()(sinogram, A), "truth": truth}
show(images, window=(40, 300)).savefig(Path(__file__).with_suffix(".png"), dpi=45)
