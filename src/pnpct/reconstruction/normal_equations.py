"""The normal equations (AᵀWA + β) x = b of the data step: their scale, and conjugate gradients."""

import math
from collections.abc import Callable
from typing import Any, TypeAlias, final

import torch
from torch import Tensor
from typing_extensions import override

from pnpct.arrays import Image, Volume
from pnpct.operators import AnyProjector, LinearOperator, Projector
from pnpct.operators.gradients import linear
from pnpct.operators.support import part_supported
from pnpct.physics import Sinogram
from pnpct.reconstruction.fbp import fbp

Operator: TypeAlias = Callable[[Image | Volume], Image | Volume]

Solve: TypeAlias = Callable[[Image | Volume, Tensor, Image | Volume], Image | Volume]
"""(b, β, x) -> better x of (AᵀWA + β) x = b: x is the image to begin from, β in the units of AᵀWA."""

MakeSolver: TypeAlias = Callable[[Sinogram, AnyProjector], Solve]
"""(sinogram, A) -> Solve. What does not depend on β is worked out once."""

Preconditioner: TypeAlias = Callable[[Tensor], Operator]
"""β -> M⁻¹, near the inverse of AᵀWA + β; β is one number, or one per image."""

INNER_ITERATIONS = 2
"""Minimum steps of an iterative solver in each data step. Warm-started they add up; an exact solution is wasted."""

MOST_INNER_ITERATIONS = 20
"""Steps that a solver takes while its residual is too large, as it is in the first data steps."""

TOLERANCE = 0.09
"""Error of a solution that is small enough, relative to its noise, both in the norm of AᵀWA + β.

In that norm the square of the noise is the number of pixels, and that of the image Σ w y²: an image of little noise is
solved more exactly than one of much.
"""

GRADIENT_TOLERANCE = 0.15
"""Residual of a gradient that is small enough, relative to what it is a solution for."""

OBJECT = 0.3
"""What attenuates more than this part of water belongs to the object."""


@final
class NormalOperator(LinearOperator):
    """H = AᵀWA + β, which is its own transpose.

    Args:
        A: The projector.
        W: The weights of the rays.
        beta: β in the units of AᵀWA, one number or one per image.
    """

    def __init__(self, A: LinearOperator, W: LinearOperator, beta: Tensor) -> None:
        self.A, self.W, self.beta = A, W, beta
        self.domain_shape = self.range_shape = A.domain_shape

    @override
    def forward(self, x: Image | Volume) -> Image | Volume:
        """Return (AᵀWA + β) x."""
        return self.A.T(self.W(self.A(x))) + self.beta * x

    @override
    def adjoint(self, y: Image | Volume) -> Image | Volume:
        """Return the same."""
        return self.forward(y)


def mean_diagonal(sinogram: Sinogram, A: AnyProjector, first: Image | Volume | None = None) -> Tensor:
    """Return the mean of the diagonal of AᵀWA over the object: what the data of each image count in a pixel.

    The object is what exceeds 0.3 of water in a first image; outside it the weights of rays through air would
    dominate. If nothing does, the mean is over the whole image. In a volume it is over the middle half of the slices:
    those at its ends are met by fewer rays.

    Args:
        sinogram: Its weights are W.
        A: The projector.
        first: A first image, in which the object is found; of a fan beam it may be None, a smooth FBP image.

    Returns:
        1 over the square of attenuation relative to water, shape (*batch, 1, 1), or with one more of a volume.

    Raises:
        ValueError: If a cone beam comes without a first image.
    """
    if first is None:
        if not isinstance(A, Projector):
            raise ValueError("The object in a cone beam is found in a first image; give one.")
        first = fbp(sinogram.line_integrals, A, kernel="soft")
    diagonal = A.gram_diagonal(sinogram.weights.diagonal)
    if not isinstance(A, Projector):
        end = A.grid.slices // 4
        middle = slice(end, A.grid.slices - end)
        diagonal, first = diagonal[..., middle, :, :], first[..., middle, :, :]
    inside = first > OBJECT
    inside = inside | ~inside.any(dim=A.domain_dims, keepdim=True)
    diagonal = diagonal.expand(inside.shape)
    return (diagonal * inside).sum(A.domain_dims, keepdim=True) / inside.sum(A.domain_dims, keepdim=True)


def penalty_of(sigma_v: float | Tensor) -> Tensor:
    """Return the penalty β = 1/σ_v² of a prior of standard deviation σ_v in HU, in the units of AᵀWA.

    Raises:
        ValueError: If `sigma_v` is not positive.
    """
    sigma_v = torch.as_tensor(sigma_v)
    if not bool(((sigma_v > 0) & sigma_v.isfinite()).all()):
        raise ValueError(f"sigma_v is a positive number of HU, got {float(sigma_v.min()):g}.")
    return (1000.0 / sigma_v).square()


def balanced_sigma_v(sinogram: Sinogram, A: AnyProjector, first: Image | Volume | None = None) -> Tensor:
    """Return the σ_v in HU of each image whose β is its `mean_diagonal`: there ADMM is fastest."""
    return 1000.0 * mean_diagonal(sinogram, A, first).rsqrt()


def conjugate_gradient(
    H: LinearOperator,
    b: Image | Volume,
    x: Image | Volume,
    Hx: Image | Volume,
    *,
    iterations: int,
    most: int = 0,
    tolerance: float | Tensor = 0.0,
    precondition: Operator | None = None,
) -> tuple[Image | Volume, Image | Volume]:
    """Improve x towards H x = b by preconditioned conjugate gradients, each image of a batch on its own.

    1. r = b − H x, z = M⁻¹ r, p = z
    2. α = ⟨r, z⟩ / ⟨p, H p⟩, x += α p, H x += α H p, r −= α H p
    3. z = M⁻¹ r, p = z + ⟨r, z⟩ / ⟨r, z⟩_before p, and again from 2

    After `iterations` steps, an image is left as it is once √⟨r, z⟩ is below `tolerance` √⟨b, M⁻¹ b⟩.

    Args:
        H: Symmetric positive definite; it is applied once in each iteration.
        b: Right-hand side.
        x: Image to begin from.
        Hx: H of it.
        iterations: Minimum steps, at least 1.
        most: Maximum steps, where this is more.
        tolerance: Residual that is small enough, relative to the right-hand side, one number or one per image.
        precondition: M⁻¹, symmetric positive definite; none for plain conjugate gradients.

    Returns:
        The better x, and H of it.

    References:
        Hestenes and Stiefel, J. Res. Natl. Bur. Stand. 49 (1952) 409.
    """

    def preconditioned(image: Image | Volume) -> Image | Volume:
        return precondition(image) if precondition else image

    def dot(one: Image | Volume, other: Image | Volume) -> Tensor:
        return (one * other).sum(H.domain_dims, keepdim=True)

    r = b - Hx
    z = preconditioned(r)
    p, rz = z, dot(r, z)
    enough = tolerance**2 * dot(b, preconditioned(b)) if most > iterations else torch.zeros_like(rz)
    last = max(iterations, most) - 1
    for iteration in range(last + 1):
        going = (rz > enough) | (iteration < iterations)
        if iteration >= iterations and not going.any():  # on a GPU each question waits for the answer
            break
        Hp = H(p)
        curvature = dot(p, Hp)
        step = torch.where(going & (curvature > 0), rz / curvature, 0.0)  # an image that is solved already stays
        x, Hx, r = x + step * p, Hx + step * Hp, r - step * Hp
        if iteration == last:
            break
        z = preconditioned(r)
        rz, before = dot(r, z), rz
        p = z + torch.where(before > 0, rz / before, 0.0) * p
    return x, Hx


def warm_started(
    sinogram: Sinogram, A: LinearOperator, iterations: int, preconditioner: Preconditioner | None = None
) -> Solve:
    """Make a solver that takes a few conjugate-gradient steps from the given image.

    It takes more, up to `MOST_INNER_ITERATIONS`, while the error exceeds `TOLERANCE`. If it begins from the image it
    answered last, AᵀWA of it is known: one product in each data step is saved, for whatever β. The gradient with
    respect to b is a solution of the same equations, to `GRADIENT_TOLERANCE`.

    Args:
        sinogram: Its weights are W.
        A: The projector.
        iterations: Minimum steps, at least 1.
        preconditioner: From β to M⁻¹; none for plain conjugate gradients.

    Raises:
        ValueError: If there is not at least one iteration.
    """
    if iterations < 1:
        raise ValueError(f"Conjugate gradients need at least one iteration, got {iterations}.")
    y, W = sinogram.line_integrals, sinogram.weights
    of_image = (y * W(y)).sum(A.range_dims).clamp(min=1e-30)[(..., *(None,) * len(A.domain_dims))]
    pixels = part_supported(A.support) * math.prod(A.domain_shape)
    tolerance = TOLERANCE * (pixels / of_image).sqrt()
    answered: list[Image | Volume] = []  # x and AᵀWA x
    prepared: list[Any] = []  # β and its M⁻¹

    def solve(b: Image | Volume, beta: Tensor, x: Image | Volume) -> Image | Volume:
        H = NormalOperator(A, W, beta)
        if preconditioner and not (prepared and torch.equal(prepared[0], beta)):
            prepared[:] = [beta, preconditioner(beta)]
        precondition = prepared[1] if preconditioner else None

        def better(b: Image | Volume) -> Image | Volume:
            known = answered and answered[0] is x
            result, Hx = conjugate_gradient(
                H,
                b,
                x.detach(),
                answered[1] + beta * x.detach() if known else H(x.detach()),
                iterations=iterations,
                most=MOST_INNER_ITERATIONS,
                tolerance=tolerance,
                precondition=precondition,
            )
            answered[:] = [result, Hx - beta * result]
            return result

        def gradient(of_x: Image | Volume) -> Image | Volume:
            nothing, most = torch.zeros_like(of_x), MOST_INNER_ITERATIONS
            return conjugate_gradient(
                H,
                of_x,
                nothing,
                nothing,
                iterations=1,
                most=most,
                tolerance=GRADIENT_TOLERANCE,
                precondition=precondition,
            )[0]

        return linear(b, better, gradient)

    return solve


def plain(sinogram: Sinogram, A: AnyProjector, *, inner_iterations: int = INNER_ITERATIONS) -> Solve:
    """Make a solver that takes plain conjugate-gradient steps."""
    return warm_started(sinogram, A, inner_iterations)
