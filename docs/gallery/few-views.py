"""A scan of 62 views: streaks by FBP, and what total variation and plug-and-play make of it."""

from pathlib import Path

from pnpct.files import load_denoiser
from pnpct.operators import Projector
from pnpct.physics import take_log
from pnpct.reconstruction import FBP, TVPWLS, PlugAndPlay
from pnpct.report import show
from pnpct.simulation import example_scan

scan, truth, grid = example_scan("head", tube_current_ma=100.0)
few = scan[::8]
A, sinogram = Projector(grid, few.geometry, mu_water=few.mu_water), take_log(few)
images = {"FBP": FBP("soft")(sinogram, A), "total variation": TVPWLS()(sinogram, A)}
images |= {"plug-and-play": PlugAndPlay(load_denoiser("n2n"))(sinogram, A), "truth": truth}
show(images, window=(40, 300)).savefig(Path(__file__).with_suffix(".png"), dpi=45)
