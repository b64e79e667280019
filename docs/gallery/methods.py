"""One scan at 5 mA by three methods, beside the truth."""

from pathlib import Path

from pnpct.files import load_denoiser
from pnpct.operators import Projector
from pnpct.physics import take_log
from pnpct.reconstruction import FBP, TVPWLS, PlugAndPlay
from pnpct.report import show
from pnpct.simulation import example_scan

scan, truth, grid = example_scan("chest", tube_current_ma=5.0)
A, sinogram = Projector(grid, scan.geometry, mu_water=scan.mu_water), take_log(scan)
methods = {"FBP": FBP("soft"), "total variation": TVPWLS(), "plug-and-play": PlugAndPlay(load_denoiser())}
images = {name: method(sinogram, A) for name, method in methods.items()}
show({**images, "truth": truth}, window=(40, 400)).savefig(Path(__file__).with_suffix(".png"), dpi=50)
