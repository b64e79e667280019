"""The same slice at three tube currents, by FBP: a quarter of the dose is twice the noise."""

from pathlib import Path

from pnpct.operators import Projector
from pnpct.physics import take_log
from pnpct.reconstruction import FBP
from pnpct.report import show
from pnpct.simulation import example_scan

images = {}
for current in (20.0, 80.0, 320.0):
    scan, _, grid = example_scan("abdomen", tube_current_ma=current)
    A = Projector(grid, scan.geometry, mu_water=scan.mu_water)
    images[f"{current:g} mA"] = FBP("soft")(take_log(scan), A)
show(images, window=(40, 400)).savefig(Path(__file__).with_suffix(".png"), dpi=45)
