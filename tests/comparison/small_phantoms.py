"""Phantoms of few pixels, and methods that need no network."""

from pnpct.comparison import Candidate, Candidates, Phantoms, Study, controls
from pnpct.denoisers import Gaussian
from pnpct.geometry import ImageGrid, Insert
from pnpct.reconstruction import TVPWLS, DenoisedFBP

INSERTS = (Insert(20.0, -60.0, (45.0, 45.0)), Insert(28.0, -40.0, (-45.0, -45.0)))
EDGE = Insert(40.0, -400.0, (0.0, 0.0))
PHANTOMS = Phantoms(ImageGrid(48, 48, spacing=4.5), views=60, bins=120, inserts=INSERTS, edge=EDGE)
STUDY = Study(phantom_repeats=0, detectability_pairs=40, tube_currents_ma=(60.0,), phantoms=PHANTOMS)
METHODS = Candidates(
    (
        *controls(),
        Candidate("tv-pwls", "TV-PWLS", "compared", TVPWLS(iterations=1)),
        Candidate("other", "other", "compared", DenoisedFBP(Gaussian(0.5))),
    )
)
