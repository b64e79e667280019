"""A fan beam on an arc: the focal spot of each view, the first fan, and the field of view."""

from pathlib import Path

from pnpct.report import show
from pnpct.simulation import clinical_fan_beam

show(clinical_fan_beam(views=120)).savefig(Path(__file__).with_suffix(".png"), dpi=50)
