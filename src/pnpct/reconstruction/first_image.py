"""A first image of all that the fan sees, for corrections of the line integrals that need one."""

from functools import lru_cache

from pnpct.arrays import Image
from pnpct.geometry import FanBeam
from pnpct.geometry.tilted_planes import WINDOWS
from pnpct.operators import Kernel, Projector
from pnpct.operators.ray_lines import Method
from pnpct.physics import Sinogram
from pnpct.reconstruction.fbp import fbp
from pnpct.reconstruction.whole_object import beyond_fan

PIXELS = 512
"""Rows and columns of the first image, of a detector with as many bins or more."""


def projector_of_everything(A: Projector) -> Projector:
    """Return a projector of the same rays onto an image of all that the fan covers, whatever the grid of A is."""
    return _of_everything(A.geometry, A.mu_water, A.method)


def first_image(sinogram: Sinogram, wide: Projector, *, kernel: Kernel) -> Image:
    """Return filtered back-projection of all that the fan covers; what reaches beyond it is continued."""
    whole = beyond_fan(sinogram, wide)
    return fbp(whole.sinogram.line_integrals, whole.A, kernel=kernel)


@lru_cache(maxsize=WINDOWS)
def _of_everything(geometry: FanBeam, mu_water: float, method: Method) -> Projector:
    """A projector takes longer to make than to use, and scans come one after the other."""
    return Projector(geometry.grid(min(PIXELS, geometry.bins)), geometry, mu_water=mu_water, method=method)
