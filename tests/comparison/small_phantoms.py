"""Phantoms of few pixels, and a plan whose networks are tiny."""

from pathlib import Path

from pnpct.comparison import Phantoms, PhantomTests, Plan
from pnpct.denoisers import RDNCBAM, RDNSize
from pnpct.files import save_network
from pnpct.geometry import ImageGrid, Insert

INSERTS = (Insert(20.0, -60.0, (45.0, 45.0)), Insert(28.0, -40.0, (-45.0, -45.0)))
EDGE = Insert(40.0, -400.0, (0.0, 0.0))
PHANTOMS = Phantoms(ImageGrid(48, 48, spacing=4.5), views=60, bins=120, inserts=INSERTS, edge=EDGE)
TESTS = PhantomTests(repeats=0, pairs=40, tube_currents_ma=(60.0,), phantoms=PHANTOMS)


def small_plan(folder: Path) -> Plan:
    """A plan with a network that changes nothing."""
    about = {"command": [], "licence": "Apache-2.0", "manifest_sha256": "0" * 64, "metrics": {}, "seed": 0}
    path = folder / "tiny.safetensors"
    save_network(path, RDNCBAM(RDNSize(features=4, growth=4, blocks=1, convolutions=2)), about=about)
    return Plan(supervised=str(path), two_stage=str(path), iterations=1)
