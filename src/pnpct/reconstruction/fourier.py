"""Conjugate gradients preconditioned in the Fourier domain: the default solver of the data step.

Without weights AᵀA is nearly a convolution Λ. The weights, seen from a pixel, are nearly one number, its `certainty`
κ². With K = diag(κ) and η = β/κ²,

    AᵀWA + β ≈ K (F*ΛF + η) K,      M⁻¹ = K⁻¹ [Σ_k S_k F* (Λ + η_k)⁻¹ F S_k] K⁻¹

where Λ is measured by noise, and S_k blends between a few levels of the logarithm of κ, S_k² adding up to one:
symmetric positive definite, one pair of FFTs per level.

References:
    Fessler and Booth, IEEE Trans. Image Process. 8 (1999) 688.
    Clinthorne et al., IEEE Trans. Med. Imaging 12 (1993) 78.
"""

import math

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

from pnpct.arrays import Image, Volume
from pnpct.operators import AnyProjector, Projector
from pnpct.operators.support import supported
from pnpct.physics import Sinogram
from pnpct.reconstruction.certainty import certainty, rays_that_count
from pnpct.reconstruction.normal_equations import (
    INNER_ITERATIONS,
    Operator,
    Preconditioner,
    Solve,
    warm_started,
)

LEVELS = 3

EVEN = 0.2
"""If the logarithms of the certainties spread by less, one level serves all pixels."""

ENOUGH = 40_000
"""Pixels of an image, evenly spread, among which its lowest and highest values are found."""

NEIGHBOURS = 9
"""Frequencies, in either direction, over which a spectrum is a mean."""

LOWEST = 1e-3
"""Of a spectrum over its median."""


def fourier(
    sinogram: Sinogram, A: AnyProjector, *, inner_iterations: int = INNER_ITERATIONS, levels: int = LEVELS
) -> Solve:
    """Make a solver of `inner_iterations` or more conjugate-gradient steps, preconditioned with `levels` levels.

    Setting up takes one projection, one back-projection, and diagonals at half the resolution.
    """
    return warm_started(sinogram, A, inner_iterations, fourier_preconditioner(sinogram, A, levels=levels))


def fourier_preconditioner(sinogram: Sinogram, A: AnyProjector, *, levels: int = LEVELS) -> Preconditioner:
    """Return what makes M⁻¹, as a map of images, for a β.

    Raises:
        ValueError: If there is not at least one level.
    """
    if levels < 1:
        raise ValueError(f"The preconditioner needs at least one level, got {levels}.")
    weights, dims, shape = sinogram.weights.diagonal, A.domain_dims, A.domain_shape
    spectrum, seen = _spectrum(A, rays_that_count(weights, A)), _seen_by_all_views(A)
    certain = certainty(weights, A)
    parts = [(level, blend / certain.sqrt()) for level, blend in _levels(certain, seen, levels)]

    def for_penalty(beta: Tensor) -> Operator:
        def of_one(image: Image | Volume, beta: Tensor, *factors: Image | Volume) -> Image | Volume:
            total = torch.zeros_like(image)
            for (level, _), factor in zip(parts, factors, strict=True):
                # Wrapping around at the border costs no iterations; padding would cost four times the work.
                transformed = torch.fft.rfftn(factor * image, dim=dims) / (spectrum + beta / level)
                total += factor * torch.fft.irfftn(transformed, s=shape, dim=dims)
            return total

        def precondition(image: Image | Volume) -> Image | Volume:
            # One image after another: the spectra of a batch are larger than the cache, and take five times as long.
            batch = image.shape[: -len(shape)]
            images = image.reshape(-1, *shape)
            betas = beta.expand(*batch, *(1,) * len(shape)).reshape(-1)
            factors = [factor.expand(image.shape).reshape(-1, *shape) for _, factor in parts]
            return torch.stack([of_one(*each) for each in zip(images, betas, *factors, strict=True)]).view(image.shape)

        return precondition

    return for_penalty


def _seen_by_all_views(A: AnyProjector) -> Tensor:
    """Return the support that no view leaves out, or everywhere if there is none."""
    plane = A.grid if isinstance(A, Projector) else A.grid.plane
    radius = np.hypot(plane.x, plane.y[:, None])
    seen: Tensor = torch.from_numpy(radius <= A.geometry.field_of_view_radius - 2 * plane.spacing)
    seen = seen if A.support is None else seen & A.support
    seen = seen if bool(seen.any()) else torch.ones_like(seen)
    return seen.expand(A.domain_shape)


def _spectrum(A: AnyProjector, counts: Tensor) -> Tensor:
    """Return the spectrum Λ of AᵀA: how much of each frequency of a noise it answers with, on the mean over the image.

    Only the rays that count take part.

    Near the highest frequencies AᵀA is no convolution: what it answers to a point depends on where that is between
    pixels and cells, and has hardly anything of some frequencies. Filters made of that are far too large there.
    """
    chance = torch.Generator().manual_seed(0)
    signs = supported((2 * torch.randint(0, 2, A.domain_shape, generator=chance) - 1).to(counts), A.support)
    noise, answer = (torch.fft.rfftn(image, dim=A.domain_dims) for image in (signs, A.adjoint(counts * A(signs))))
    # AᵀA falls like one over the frequency: times it, a mean over neighbours is not that of a steep slope.
    rows, cols = A.domain_shape[-2:]
    frequency = torch.hypot(torch.fft.fftfreq(rows)[:, None], torch.fft.rfftfreq(cols)).clamp(min=1 / max(rows, cols))
    frequency = frequency.to(counts)
    common = _of_neighbours(frequency * (noise.conj() * answer).real)
    spectrum = common / _of_neighbours(noise.abs().square()) / frequency
    positive: Tensor = spectrum.clamp(min=LOWEST * float(spectrum.median()))
    return positive


def _of_neighbours(spectrum: Tensor) -> Tensor:
    """Return means over squares of neighbouring frequencies in the plane."""
    planes = spectrum.reshape(-1, 1, *spectrum.shape[-2:])
    return functional.avg_pool2d(planes, NEIGHBOURS, stride=1, padding=NEIGHBOURS // 2).reshape(spectrum.shape)


def _levels(certain: Image | Volume, seen: Tensor, levels: int) -> list[tuple[float, Image | Volume]]:
    """Return levels, which span the pixels that are seen, and the square root of the share of each in each pixel."""
    values = _in_order(certain, seen).log()
    low, high = (float(values[int(part * (len(values) - 1))]) for part in (0.002, 0.998))
    if levels == 1 or high - low < EVEN:
        return [(math.exp((low + high) / 2), torch.ones_like(certain))]
    at = ((certain.log() - low) / (high - low) * (levels - 1)).clamp(0, levels - 1)
    knots = np.exp(np.linspace(low, high, levels)).tolist()
    return [(knot, (1 - (at - level).abs()).clamp(min=0).sqrt()) for level, knot in enumerate(knots)]


def _in_order(images: Tensor, where: Tensor) -> Float[Tensor, "values"]:
    """Return some values of all images, evenly spread over those `where`, from the lowest to the highest."""
    places = where.flatten().nonzero().squeeze(-1).to(images.device)
    return images.flatten(-where.ndim)[..., places[:: max(1, len(places) // ENOUGH)]].flatten().sort().values
