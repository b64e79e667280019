"""Conjugate gradients preconditioned in the Fourier domain: the default solver of the data step.

Without weights AᵀA is nearly a convolution Λ. The weights, seen from a pixel, are nearly one number: its certainty
κ² = Σ a²w / Σ a². With K = diag(κ) and η = β/κ²,

    AᵀWA + β ≈ K (F*ΛF + η) K,      M⁻¹ = K⁻¹ [Σ_k S_k F* (Λ + η_k)⁻¹ F S_k] K⁻¹

where S_k blends between a few levels η_k of the logarithm of η, S_k² adding up to one: symmetric positive definite,
one pair of FFTs per level.

References:
    Fessler and Booth, IEEE Trans. Image Process. 8 (1999) 688.
    Clinthorne et al., IEEE Trans. Med. Imaging 12 (1993) 78.
"""

import numpy as np
import torch
from torch import Tensor

from pnpct.arrays import Image, Volume
from pnpct.operators import AnyProjector, Projector
from pnpct.operators.linear_operator import Shape
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

AROUND = ((0, 0), (-1, 0), (1, 0), (0, -1), (0, 1))
"""Where the points are whose responses make the spectrum of a limited angle, in thirds of the image from its middle."""

LOWEST = 0.1
"""Of the spectrum of a volume over its median; single values of it, near the axis, are off."""

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
    """Return the spectrum Λ of AᵀA from its response to a point in the middle.

    In a volume each place is met from some directions more often than from others. On the mean over the volume none is
    preferred: Λ is the mean around the axis.

    Of a limited angle the response is too long for the image, along the rays: cut off at the border, it has a spectrum
    with negative values, which AᵀA has not; and the directions that are measured turn with the place in the fan. Then Λ
    is the mean over five points, each under a window of no negative spectrum.
    """
    spectrum = torch.fft.rfftn(_response(A, like, (0, 0))).real
    floor = max(1e-3 * float(spectrum.abs().median()), 0.2 * float(spectrum.abs().min()))
    if not isinstance(A, Projector):
        spectrum = _around_the_axis(spectrum, A.domain_shape)
        floor = LOWEST * float(spectrum.median())
    elif A.geometry.limited_angle:
        rows, cols = A.grid.shape
        window = _triangle(rows, like)[:, None] * _triangle(cols, like)
        spectrum = torch.stack([torch.fft.rfft2(_response(A, like, place) * window).real for place in AROUND]).mean(0)
    positive: Tensor = spectrum.clamp(min=floor)
    return positive


def _response(A: AnyProjector, like: Tensor, place: tuple[int, int]) -> Image | Volume:
    """Return AᵀA of a point, turned to element 0; the place is in thirds of the image from its middle."""
    shape = A.domain_shape
    of_axes = (0,) * (len(shape) - 2) + place
    middle = tuple(side // 2 + part * side // 3 for side, part in zip(shape, of_axes, strict=True))
    point = like.new_zeros(shape)
    point[middle] = 1.0
    return torch.roll(A.adjoint(A(point)), [-each for each in middle], A.domain_dims)


def _around_the_axis(spectrum: Tensor, shape: Shape) -> Tensor:
    """Return the means over rings of one frequency in the plane, of the half of a spectrum that rfftn gives."""
    rows, cols = (torch.fft.fftfreq(shape[-2])[:, None], torch.fft.rfftfreq(shape[-1]))
    ring = (torch.hypot(rows, cols) * max(shape[-2:])).round().long().to(spectrum.device)
    number = ring.flatten()
    sums = spectrum.new_zeros(shape[0], int(ring.max()) + 1).index_add(1, number, spectrum.flatten(1))
    return (sums / number.bincount())[:, ring]


def _triangle(length: int, like: Tensor) -> Tensor:
    """Return a triangle around element 0 of a circle, whose spectrum is nowhere negative."""
    number = torch.arange(length, dtype=like.dtype, device=like.device)
    return 1 - 2 * torch.minimum(number, length - number) / length


def _levels(scaled: Image | Volume, seen: Tensor, levels: int) -> tuple[Tensor, list[Image | Volume]]:
    """Return the logarithms of the levels, and for each the square root of its share in each pixel that is seen."""
    values = scaled[..., seen].flatten().sort().values
    low, high = (float(values[int(part * (len(values) - 1))]) for part in (0.002, 0.998))
    if levels == 1 or high - low < EVEN:
        return scaled.new_tensor([(low + high) / 2]), [torch.ones_like(scaled)]
    at = ((scaled - low) / (high - low) * (levels - 1)).clamp(0, levels - 1)
    blends = [(1 - (at - level).abs()).clamp(min=0).sqrt() for level in range(levels)]
    return torch.linspace(low, high, levels, dtype=scaled.dtype, device=scaled.device), blends
