"""From a sinogram to an image in one call."""

from collections.abc import Callable, Iterable
from typing import Literal

import torch

from pnpct.arrays import Image
from pnpct.denoisers import Denoise
from pnpct.operators import Projector
from pnpct.physics import Sinogram
from pnpct.reconstruction.fourier import fourier
from pnpct.reconstruction.normal_equations import MakeSolver
from pnpct.reconstruction.pnp_admm import BETA, ADMMState, pnp_admm
from pnpct.reconstruction.starting import starting_state
from pnpct.reconstruction.stopping import StopRule, relative_rule, until

ITERATIONS = 20

Result = Callable[[Iterable[ADMMState]], Image]
"""From all iterates to the image."""

ResultName = Literal["last", "mean"]


def mean_iterate(states: Iterable[ADMMState]) -> Image:
    """Return the mean of the denoised iterates v.

    It is for trained networks. They are the proximal maps of no function: where the iterates should settle, they go on
    wandering and lose some of the finest detail, and their mean does less of both. With a convex prior it has the
    same limit, but gets there only as fast as 1 / iterations.

    Args:
        states: Iterates of ADMM, at least one.

    Raises:
        ValueError: If there is none.

    References:
        He and Yuan, SIAM J. Numer. Anal. 50 (2012) 700.
    """
    mean: Image | None = None
    for number, state in enumerate(states, start=1):
        mean = state.v if mean is None else torch.lerp(mean, state.v, 1 / number)
    return _not_none(mean)


def last_iterate(states: Iterable[ADMMState]) -> Image:
    """Return the last of the denoised iterates v, which is nearest to the limit where there is one.

    Raises:
        ValueError: If there is none.
    """
    last: Image | None = None
    for state in states:
        last = state.v
    return _not_none(last)


RESULTS: dict[ResultName, Result] = {"last": last_iterate, "mean": mean_iterate}


def reconstruct(
    sinogram: Sinogram,
    A: Projector,
    denoise: Denoise,
    *,
    beta: float = BETA,
    damping: float = 0.0,
    iterations: int = ITERATIONS,
    stop: StopRule = relative_rule,
    solver: MakeSolver = fourier,
    result: Result = last_iterate,
) -> Image:
    """Reconstruct by plug-and-play ADMM, beginning where `starting_state` says.

    It is the loop around `pnp_admm` for who wants the image alone; write the loop to watch, draw or save.

    Args:
        sinogram: Line integrals and weights.
        A: The projector.
        denoise: Denoiser with its strength inside.
        beta: Penalty in mean diagonals of AᵀWA, > 0.
        damping: Share of u that each iteration forgets; around a trained network `DAMPING` is nearer to the truth.
        iterations: Most iterations, at least 1.
        stop: Rule that says when to stop before.
        solver: Makes the solver of the data step.
        result: Makes the image of the iterates; around a trained network `mean_iterate` is nearer to the truth.

    Returns:
        The image, relative to water.

    Raises:
        ValueError: If `beta`, `damping` or `iterations` is out of its range.
    """
    start = starting_state(sinogram, A)
    states = pnp_admm(sinogram, A, denoise, start, beta=beta, damping=damping, solver=solver)
    return result(until(states, start, iterations=iterations, stop=stop))


def _not_none(image: Image | None) -> Image:
    if image is None:
        raise ValueError("ADMM has no image without an iteration.")
    return image
