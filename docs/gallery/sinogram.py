"""What a scanner measures of a pelvis with a metal hip at 40 mA: line integrals, view below view."""

from pathlib import Path

from pnpct.report import show
from pnpct.simulation import example_scan

scan, _, _ = example_scan("pelvis")
show(scan).savefig(Path(__file__).with_suffix(".png"), dpi=45)
