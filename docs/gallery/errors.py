"""What is wrong with each image: its difference from the truth, in HU around 0."""

from pathlib import Path

from pnpct.files import load_denoiser
from pnpct.operators import Projector
from pnpct.physics import take_log
from pnpct.reconstruction import FBP, TVPWLS, PlugAndPlay
from pnpct.report import show
from pnpct.simulation import example_scan

scan, truth, grid = example_scan("head", tube_current_ma=20.0)
A, sinogram = Projector(grid, scan.geometry, mu_water=scan.mu_water), take_log(scan)
methods = {"FBP": FBP("soft"), "total variation": TVPWLS(), "plug-and-play": PlugAndPlay(load_denoiser())}
wrong = {name: 1 + method(sinogram, A).image - truth for name, method in methods.items()}
show(wrong, window=(0, 200)).savefig(Path(__file__).with_suffix(".png"), dpi=45)
