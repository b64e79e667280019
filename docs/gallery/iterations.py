"""Plug-and-play ADMM as it goes: the start, and the image after each iteration."""

from itertools import islice
from pathlib import Path

from pnpct.denoisers import TotalVariation
from pnpct.operators import Projector
from pnpct.physics import take_log
from pnpct.reconstruction import FBP, ADMMState, PlugAndPlay
from pnpct.report import show
from pnpct.simulation import example_scan

scan, _, grid = example_scan("abdomen", tube_current_ma=10.0)
A, sinogram = Projector(grid, scan.geometry, mu_water=scan.mu_water), take_log(scan)
start = ADMMState.start(FBP("ram-lak")(sinogram, A).image)
states = PlugAndPlay(TotalVariation(0.03)).states(sinogram, A, start)
images = {f"iteration {number}": state.v for number, state in enumerate(islice(states, 3), start=1)}
show({"start": start.x, **images}, window=(40, 400)).savefig(Path(__file__).with_suffix(".png"), dpi=45)
