"""Total variation in the loop: where plug-and-play begins, and TV-PWLS."""

from collections.abc import Iterator
from itertools import islice

from pnpct.denoisers import DENOISERS, TotalVariation
from pnpct.operators import Projector
from pnpct.physics import Sinogram
from pnpct.reconstruction.fbp import fbp
from pnpct.reconstruction.normal_equations import balanced_sigma_v
from pnpct.reconstruction.pnp_admm import SIGMA_V, ADMMState, pnp_admm

FIRST_ITERATIONS = 6


def starting_state(sinogram: Sinogram, A: Projector) -> ADMMState:
    """Return the state to begin from: an image after a few iterations around total variation.

    Where hardly a photon arrives, behind metal or in the middle of a large patient, FBP has streaks. The data say too
    little there to take them away again, and networks take them for anatomy.

    Args:
        sinogram: Line integrals and weights.
        A: The projector.
    """
    smooth = ADMMState.start(fbp(sinogram.line_integrals, A, kernel="soft"))
    states = around_total_variation(sinogram, A, smooth, strength=DENOISERS["tv"].usual)
    return ADMMState.start(next(islice(states, FIRST_ITERATIONS - 1, None)).v)


def around_total_variation(
    sinogram: Sinogram, A: Projector, start: ADMMState, *, strength: float
) -> Iterator[ADMMState]:
    """Yield the iterates whose limit has the least ½ ‖A x − y‖²_W + λ · TV(x), λ = strength / σ_v², for ever.

    The limit does not depend on the penalty of ADMM, so that is the one that is fastest.

    Args:
        sinogram: Line integrals and weights.
        A: The projector.
        start: The state to begin from.
        strength: Strength at the default σ_v of plug-and-play, HU × pixel, ≥ 0.
    """
    sigma_v = balanced_sigma_v(sinogram, A)
    denoise = TotalVariation(strength / 1000 * (sigma_v / SIGMA_V) ** 2)
    return pnp_admm(sinogram, A, denoise, start, sigma_v=sigma_v)
