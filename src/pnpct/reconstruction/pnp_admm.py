"""Plug-and-play ADMM: the paper's equations (2) to (6).

The image that fits the weighted data and a prior R,

    min ½ ‖A x − y‖²_W + λ R(v)   such that   x = v                                       (2), (3)

is found by alternating. Given v and the scaled dual variable u, x solves the normal equations (4a), (5); a denoiser
takes the place of the proximal map of R (4b), (6); u collects what x and v disagree about (4c):

    (AᵀWA + β) x = AᵀW y + β (v − u)
    v = D(x + u)
    u = u + x − v

The penalty is given as σ_v, the standard deviation in HU to which the denoised image is trusted: β = 1/σ_v². The
weights are inverse variances, so that data and prior are in balance at every dose, and what the denoiser gets, x + u,
has about as much noise at every dose.

Part of u may be dropped in each iteration: u = (1 − damping) (u + x − v).
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import repeat

import torch
from torch import Tensor

from pnpct.arrays import Image, Volume
from pnpct.denoisers import Denoise
from pnpct.geometry.short_repr import short_repr
from pnpct.operators import AnyProjector
from pnpct.physics import Sinogram
from pnpct.reconstruction.fourier import fourier
from pnpct.reconstruction.normal_equations import MakeSolver, penalty_of

SIGMA_V = 60.0
"""HU, for every dose and every size of patient. The paper's β of 1.2 has no unit."""


@dataclass(frozen=True, eq=False)
class ADMMState:
    """The three iterates of ADMM. To resume, pass a state back.

    Args:
        x: Image fitted to the data, relative to water.
        v: Denoised image; the result.
        u: Scaled dual variable: the sum of what the denoiser has removed and the data demand back.

    Raises:
        ValueError: If the shapes differ.
    """

    x: Image | Volume
    v: Image | Volume
    u: Image | Volume

    __repr__ = short_repr

    def __post_init__(self) -> None:
        if not self.x.shape == self.v.shape == self.u.shape:
            raise ValueError(
                f"The iterates x, v, u have one shape, got {tuple(self.x.shape)}, {tuple(self.v.shape)} and "
                f"{tuple(self.u.shape)}."
            )

    @classmethod
    def start(cls, image: Image | Volume) -> "ADMMState":
        """Begin from an image, usually that of filtered back-projection."""
        return cls(x=image, v=image, u=torch.zeros_like(image))


def pnp_admm(
    sinogram: Sinogram,
    A: AnyProjector,
    denoise: Denoise,
    state: ADMMState,
    *,
    sigma_v: float | Tensor | Iterable[Tensor] = SIGMA_V,
    damping: float = 0.0,
    solver: MakeSolver = fourier,
) -> Iterator[ADMMState]:
    """Yield the iterates of plug-and-play ADMM, for ever; the caller's loop says when to stop.

    Where gradients are recorded and D has them, they pass through all iterates.

    Args:
        sinogram: Line integrals y and weights W.
        A: The projector.
        denoise: D, with its strength inside.
        state: State to begin or continue from.
        sigma_v: Standard deviation to which the denoised image is trusted, HU, > 0; one number or one per image, or
            those of each iteration, for ever. From one to the next the dual variable β u stays.
        damping: Fraction of u that each iteration drops, 0 ≤ damping ≤ 1. The paper has 0, where x and v agree in the
            limit; 1 is half-quadratic splitting, without u.
        solver: Makes the solver of the normal equations from (sinogram, A).

    Yields:
        The state after each iteration.

    Raises:
        ValueError: If `sigma_v` is not positive or `damping` not from 0 to 1 (at the first iteration).

    References:
        Hajinezhad and Hong, Math. Program. 176 (2019) 207, for the damping;
        Venkatakrishnan, Bouman and Wohlberg, GlobalSIP (2013) 945; the paper, Eqs. (4) to (6).
    """
    check_damping(damping)
    y, W = sinogram.line_integrals, sinogram.weights
    AtWy, solve = A.T(W(y)), solver(sinogram, A)
    of_iterations = iter(sigma_v) if not isinstance(sigma_v, float | int | Tensor) else repeat(sigma_v)
    beta = before = penalty_of(next(of_iterations)).to(y)

    x, v, u = state.x, state.v, state.u
    while True:
        u = u * (before / beta)
        x = solve(AtWy + beta * (v - u), beta, x)  # (4a), (5)
        v = denoise(x + u)  # (4b), (6)
        u = (1 - damping) * (u + x - v)  # (4c)
        yield ADMMState(x, v, u)
        before, beta = beta, penalty_of(next(of_iterations)).to(y)


def check_damping(damping: float) -> None:
    """Check that a damping is possible.

    Raises:
        ValueError: If it is not from 0 to 1.
    """
    if not 0 <= damping <= 1:
        raise ValueError(f"damping is a fraction from 0 to 1, got {damping}.")
