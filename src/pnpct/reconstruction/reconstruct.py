"""From a sinogram to an image in one call."""

from pnpct.arrays import Image
from pnpct.denoisers import Denoise
from pnpct.operators import Projector
from pnpct.physics import Sinogram
from pnpct.reconstruction.fbp import fbp
from pnpct.reconstruction.fourier import fourier
from pnpct.reconstruction.normal_equations import MakeSolver
from pnpct.reconstruction.pnp_admm import BETA, ADMMState, pnp_admm
from pnpct.reconstruction.stopping import StopRule, relative_rule, until

ITERATIONS = 20


def reconstruct(
    sinogram: Sinogram,
    A: Projector,
    denoise: Denoise,
    *,
    beta: float = BETA,
    iterations: int = ITERATIONS,
    stop: StopRule = relative_rule,
    solver: MakeSolver = fourier,
) -> Image:
    """Reconstruct by plug-and-play ADMM, beginning from a smooth FBP image.

    It is the loop around `pnp_admm` for who wants the image alone; write the loop to watch, draw or save.

    Args:
        sinogram: Line integrals and weights.
        A: The projector.
        denoise: Denoiser with its strength inside.
        beta: Penalty in mean diagonals of AᵀWA, > 0.
        iterations: Most iterations, at least 1.
        stop: Rule that says when to stop before.
        solver: Makes the solver of the data step.

    Returns:
        The denoised iterate v, relative to water.

    Raises:
        ValueError: If `beta` or `iterations` is out of its range.
    """
    start = ADMMState.start(fbp(sinogram.line_integrals, A, kernel="soft"))
    states = pnp_admm(sinogram, A, denoise, start, beta=beta, solver=solver)
    *_, last = until(states, start, iterations=iterations, stop=stop)
    return last.v
