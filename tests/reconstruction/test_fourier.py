"""The preconditioner in the Fourier domain undoes AᵀWA + β on the mean, at every frequency."""

import pytest
import torch

from pnpct.geometry import FanBeam, ImageGrid, evenly_spaced_views
from pnpct.operators import Projector
from pnpct.physics import DiagonalWeights, Sinogram
from pnpct.reconstruction.fourier import fourier_preconditioner
from pnpct.reconstruction.normal_equations import NormalOperator

PARTS = 8
"""Parts of the frequencies in either direction."""


@pytest.mark.parametrize("spacing", [0.9, 1.8])
def test_on_the_mean_noise_of_all_frequencies_comes_back_as_it_was(spacing: float, generator: torch.Generator) -> None:
    """Filters made of the response to one point are twenty times too large where that has hardly anything."""
    geometry = FanBeam(
        evenly_spaced_views(400),
        bins=240,
        source_to_isocenter=595.0,
        source_to_detector=1085.6,
        bin_width=1.2858 * spacing / 0.9,
        detector_offset=-1.0,
    )
    A = Projector(ImageGrid(128, 128, spacing), geometry, mu_water=0.0192)
    weights = DiagonalWeights(torch.full(geometry.shape, 1e4))
    beta = A.gram_diagonal(weights.diagonal).mean().reshape(1, 1) / 100
    undo = fourier_preconditioner(Sinogram(torch.zeros(geometry.shape), weights), A)(beta)
    common, power = torch.zeros(PARTS, PARTS), torch.zeros(PARTS, PARTS)
    for _ in range(4):
        noise = torch.randn(A.grid.shape, generator=generator)
        before, after = torch.fft.fft2(noise), torch.fft.fft2(undo(NormalOperator(A, weights, beta)(noise)))
        common += of_parts((before.conj() * after).real)
        power += of_parts(before.abs().square())
    assert (common / power).min() > 0.9
    assert (common / power).max() < 1.1


def of_parts(spectrum: torch.Tensor) -> torch.Tensor:
    """Sums over squares of frequencies."""
    side = spectrum.shape[0] // PARTS
    return torch.fft.fftshift(spectrum).unflatten(0, (PARTS, side)).unflatten(2, (PARTS, side)).sum((1, 3))
