"""Conjugate gradients preconditioned in the Fourier domain: the default solver of the data step.

Without weights AᵀA is nearly a convolution Λ. The weights, seen from a pixel, are nearly one number: its certainty
κ² = Σ a²w / Σ a². With K = diag(κ) and η = β/κ²,

    AᵀWA + β ≈ K (F*ΛF + η) K,      M⁻¹ = K⁻¹ [Σ_k S_k F* (Λ + η_k)⁻¹ F S_k] K⁻¹

where Λ is measured by noise, and S_k blends between a few levels η_k of the logarithm of η, S_k² adding up to one:
symmetric positive definite, one pair of FFTs per level.

References:
    Fessler and Booth, IEEE Trans. Image Process. 8 (1999) 688.
    Clinthorne et al., IEEE Trans. Med. Imaging 12 (1993) 78.
"""

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from pnpct.arrays import Image, Volume
from pnpct.operators import AnyProjector, Projector
from pnpct.physics import Sinogram
from pnpct.reconstruction.normal_equations import (
    INNER_ITERATIONS,
    Operator,
    Preconditioner,
    Solve,
    warm_started,
)

LEVELS = 3

EVEN = 0.05
"""If the logarithms of the certainties spread by less, one level serves all pixels."""

ENOUGH = 40_000
"""Pixels of an image, evenly spread, among which the lowest and the highest certainty are found."""

NEIGHBOURS = 9
"""Frequencies, in either direction, over which a spectrum is a mean."""

LOWEST = 1e-3
"""Of a spectrum over its median."""

FAINTEST = 1e-3
"""A pixel of less certainty, relative to the median, counts as one that no ray meets."""


def fourier(
    sinogram: Sinogram, A: AnyProjector, *, inner_iterations: int = INNER_ITERATIONS, levels: int = LEVELS
) -> Solve:
    """Make a solver of `inner_iterations` or more conjugate-gradient steps, preconditioned with `levels` levels.

    Setting up takes one projection, one back-projection and two diagonals.
    """
    return warm_started(sinogram, A, inner_iterations, fourier_preconditioner(sinogram, A, levels=levels))


def fourier_preconditioner(sinogram: Sinogram, A: AnyProjector, *, levels: int = LEVELS) -> Preconditioner:
    """Return what makes M⁻¹, as a map of images, for a β.

    Raises:
        ValueError: If there is not at least one level.
    """
    if levels < 1:
        raise ValueError(f"The preconditioner needs at least one level, got {levels}.")
    weights = sinogram.weights.diagonal
    diagonal = A.gram_diagonal(weights)
    seen = _seen_by_all_views(A).to(diagonal.device)
    measured = diagonal / A.gram_diagonal(torch.ones_like(weights)).clamp(min=1e-30)
    faintest = FAINTEST * float(measured.median())
    spectrum, dims = _spectrum(A, weights), A.domain_dims

    def for_penalty(beta: Tensor) -> Operator:
        knots, blends = _levels((beta / measured.clamp(min=faintest)).log(), seen, levels)
        # Where no ray meets a pixel, H is β and K η K must not be less, or M⁻¹H has its largest eigenvalues there.
        certainty = torch.where(measured < faintest, beta / knots[-1].exp(), measured)
        filters = [1 / (spectrum + knot.exp()) for knot in knots]
        outer = certainty.rsqrt()

        def of_one(image: Image | Volume, outer: Image | Volume, *blends: Image | Volume) -> Image | Volume:
            inner = outer * image
            total = torch.zeros_like(inner)
            for response, blend in zip(filters, blends, strict=True):
                # Wrapping around at the border costs no iterations; padding would cost four times the work.
                transformed = torch.fft.rfftn(blend * inner, dim=dims) * response
                total += blend * torch.fft.irfftn(transformed, s=A.domain_shape, dim=dims)
            return outer * total

        def precondition(image: Image | Volume) -> Image | Volume:
            # One image after another: the spectra of a batch are larger than the cache, and take five times as long.
            parts = [part.expand(image.shape).reshape(-1, *A.domain_shape) for part in (image, outer, *blends)]
            return torch.stack([of_one(*each) for each in zip(*parts, strict=True)]).view(image.shape)

        return precondition

    return for_penalty


def _seen_by_all_views(A: AnyProjector) -> Tensor:
    """Return where no view leaves a pixel out, or everywhere if there is none: the levels are spread over these."""
    plane = A.grid if isinstance(A, Projector) else A.grid.plane
    radius = np.hypot(plane.x, plane.y[:, None])
    seen: Tensor = torch.from_numpy(radius <= A.geometry.field_of_view_radius - 2 * plane.spacing)
    seen = seen if bool(seen.any()) else torch.ones_like(seen)
    return seen.expand(A.domain_shape)


def _spectrum(A: AnyProjector, like: Tensor) -> Tensor:
    """Return the spectrum Λ of AᵀA: how much of each frequency of a noise it answers with, on the mean over the image.

    Near the highest frequencies AᵀA is no convolution: what it answers to a point depends on where that is between
    pixels and cells, and has hardly anything of some frequencies. Filters made of that are far too large there.
    """
    chance = torch.Generator().manual_seed(0)
    signs = (2 * torch.randint(0, 2, A.domain_shape, generator=chance) - 1).to(like)
    noise, answer = (torch.fft.rfftn(image, dim=A.domain_dims) for image in (signs, A.adjoint(A(signs))))
    rows, cols = A.domain_shape[-2:]
    # AᵀA falls like one over the frequency: times it, a mean over neighbours is not that of a steep slope.
    frequency = torch.hypot(torch.fft.fftfreq(rows)[:, None], torch.fft.rfftfreq(cols)).clamp(min=1 / max(rows, cols))
    frequency = frequency.to(like)
    common = _of_neighbours(frequency * (noise.conj() * answer).real)
    spectrum = common / _of_neighbours(noise.abs().square()) / frequency
    positive: Tensor = spectrum.clamp(min=LOWEST * float(spectrum.median()))
    return positive


def _of_neighbours(spectrum: Tensor) -> Tensor:
    """Return means over squares of neighbouring frequencies in the plane."""
    planes = spectrum.reshape(-1, 1, *spectrum.shape[-2:])
    return functional.avg_pool2d(planes, NEIGHBOURS, stride=1, padding=NEIGHBOURS // 2).reshape(spectrum.shape)


def _levels(scaled: Image | Volume, seen: Tensor, levels: int) -> tuple[Tensor, list[Image | Volume]]:
    """Return the logarithms of the levels, and for each the square root of its share in each pixel that is seen."""
    places = seen.flatten().nonzero().squeeze(-1)
    some = places[:: max(1, len(places) // ENOUGH)]
    values = scaled.flatten(-seen.ndim)[..., some].flatten().sort().values
    low, high = (float(values[int(part * (len(values) - 1))]) for part in (0.002, 0.998))
    if levels == 1 or high - low < EVEN:
        return scaled.new_tensor([(low + high) / 2]), [torch.ones_like(scaled)]
    at = ((scaled - low) / (high - low) * (levels - 1)).clamp(0, levels - 1)
    blends = [(1 - (at - level).abs()).clamp(min=0).sqrt() for level in range(levels)]
    return torch.linspace(low, high, levels, dtype=scaled.dtype, device=scaled.device), blends
