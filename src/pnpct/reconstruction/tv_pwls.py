"""Penalised weighted least squares with total variation: the baseline that learned priors have to beat."""

from collections.abc import Iterator

from pnpct.denoisers import TotalVariation
from pnpct.operators import Projector
from pnpct.physics import Sinogram
from pnpct.reconstruction.pnp_admm import BETA, ADMMState, pnp_admm

STRENGTH = 0.07
"""λ in units of the image × pixel."""


def tv_pwls(
    sinogram: Sinogram,
    A: Projector,
    state: ADMMState,
    *,
    strength: float = STRENGTH,
    beta: float = BETA,
) -> Iterator[ADMMState]:
    """Yield iterates that converge to the minimiser of ½ ‖A x − y‖²_W / d + strength · TV(x).

    d is the mean diagonal of AᵀWA, so that one strength serves every dose and geometry. The iterates are those of
    ADMM with the proximal map of total variation at strength/β: with a convex prior the limit does not depend on β.

    Args:
        sinogram: Line integrals and weights.
        A: The projector.
        state: Where to begin or to go on from.
        strength: λ ≥ 0, in units of the image × pixel.
        beta: Penalty of ADMM: only the speed depends on it.

    Yields:
        The state after each iteration.

    Raises:
        ValueError: If `beta` is not positive or `strength` negative.

    References:
        Sidky and Pan, Phys. Med. Biol. 53 (2008) 4777; Fessler, IEEE Trans. Image Process. 3 (1994) 290.
    """
    if not 0 < beta < float("inf"):
        raise ValueError(f"beta must be a positive number, got {beta}.")
    return pnp_admm(sinogram, A, TotalVariation(strength / beta), state, beta=beta)
