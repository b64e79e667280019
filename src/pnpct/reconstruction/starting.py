"""Where plug-and-play ADMM begins."""

from itertools import islice

from pnpct.denoisers import TotalVariation
from pnpct.denoisers.learned import DENSEST
from pnpct.operators import Projector
from pnpct.physics import Sinogram
from pnpct.reconstruction.fbp import fbp
from pnpct.reconstruction.pnp_admm import ADMMState, pnp_admm

ITERATIONS_AT_METAL, STRENGTH_AT_METAL = 5, 0.15
"""Iterations around total variation and its strength, image × pixel, that remove the streaks of metal."""


def starting_state(sinogram: Sinogram, A: Projector) -> ADMMState:
    """Return the state to begin from: a smooth FBP image, without the streaks of metal if there are any.

    Rays through metal have almost no weight, so the data step leaves the streaks that FBP makes of them, and networks
    take them for anatomy. A few iterations around total variation remove them first.

    Args:
        sinogram: Line integrals and weights.
        A: The projector.
    """
    state = ADMMState.start(fbp(sinogram.line_integrals, A, kernel="soft"))
    if not bool((state.v > DENSEST).any()):
        return state
    states = pnp_admm(sinogram, A, TotalVariation(STRENGTH_AT_METAL), state)
    return ADMMState.start(next(islice(states, ITERATIONS_AT_METAL - 1, None)).v)
