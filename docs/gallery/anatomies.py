"""The procedural patients: every seed is another one."""

from pathlib import Path

from pnpct.report import show
from pnpct.simulation import example_scan

images = {name: example_scan(name, seed=3)[1] for name in ("head", "chest", "abdomen", "pelvis")}
show(images, window=(40, 400)).savefig(Path(__file__).with_suffix(".png"), dpi=50)
