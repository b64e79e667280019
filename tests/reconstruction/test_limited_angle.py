"""Plug-and-play on a limited angle: a preconditioner may cost iterations, never the answer."""

import itertools
import math
from dataclasses import replace

import pytest
import torch

from pnpct.denoisers import TotalVariation
from pnpct.geometry import FanBeam, ImageGrid
from pnpct.operators import Projector
from pnpct.physics import DiagonalWeights, Sinogram
from pnpct.reconstruction import (
    ADMMState,
    fbp,
    mean_diagonal,
    pnp_admm,
    reconstruct,
    solver_by_name,
    starting_state,
)
from pnpct.reconstruction.fourier import fourier_preconditioner
from pnpct.reconstruction.starting import possible, smooth_state

SCANNER = FanBeam((0.0,), 90, source_to_isocenter=410.66, source_to_detector=553.74, bin_width=1.24, detector="flat")
GRID = ImageGrid(32, 32, spacing=2.5)


def limited(degrees: int) -> tuple[Sinogram, Projector]:
    """A disc of water with a hole, from views two degrees apart; the corners of the image are met by no ray."""
    views = [math.radians(270 + view) for view in range(0, degrees + 1, 2)]
    A = Projector(GRID, replace(SCANNER, view_angles=views), mu_water=0.04)
    x, y = torch.from_numpy(GRID.x), torch.from_numpy(GRID.y)[:, None]
    line_integrals = A(((x**2 + y**2 < 35**2) & ((x - 12) ** 2 + y**2 > 6**2)).float())
    return Sinogram(line_integrals, DiagonalWeights(1e4 * torch.exp(-line_integrals))), A


def largest(operator) -> float:
    """The largest eigenvalue, by power iterations."""
    image = torch.rand(GRID.shape, generator=torch.Generator().manual_seed(1))
    for _ in range(40):
        image = operator(image / image.norm())
    return float(image.norm())


@pytest.mark.parametrize("degrees", [20, 45, 120])
def test_the_preconditioner_makes_no_direction_larger_than_the_measured_ones(degrees):
    """Else conjugate gradients see that direction alone: the largest eigenvalue of M⁻¹H was 570 in the corners."""
    sinogram, A = limited(degrees)
    beta = mean_diagonal(sinogram, A)
    precondition = fourier_preconditioner(sinogram, A)(beta)
    assert largest(lambda image: precondition(A.T(sinogram.weights(A(image))) + beta * image)) < 30


@pytest.mark.parametrize(("degrees", "limited"), [(360, False), (220, False), (180, False), (150, True), (30, True)])
def test_the_views_alone_say_whether_the_angle_is_limited(degrees, limited):
    """The sign of the spectrum does not: with pixels smaller than the bins a full rotation has negative values too."""
    assert replace(SCANNER, view_angles=[math.radians(view) for view in range(degrees)]).limited_angle is limited


@pytest.mark.parametrize("degrees", [30, 90])
def test_all_solvers_arrive_at_the_same_image(degrees):
    sinogram, A = limited(degrees)
    start = ADMMState.start(torch.zeros(GRID.shape))
    images = [
        next(itertools.islice(pnp_admm(sinogram, A, TotalVariation(0.07), start, solver=solver), 4, None)).v
        for solver in (solver_by_name("fourier", inner_iterations=60), solver_by_name("dense-cholesky"))
    ]
    assert 1000 * float((images[0] - images[1]).square().mean().sqrt()) < 1.0


@pytest.mark.parametrize("degrees", [20, 30, 60])
def test_it_begins_without_streaks_that_no_data_take_away(degrees):
    """FBP of such a scan has them in the directions that no view has seen."""
    sinogram, A = limited(degrees)
    assert float(fbp(sinogram.line_integrals, A, kernel="soft").min()) < -2.5
    begun = starting_state(sinogram, A).v
    assert 0 <= float(begun.min()) < float(begun.max()) < 1.5
    assert not smooth_state(sinogram, A).v.any()


@pytest.mark.parametrize("solver", ["cg", "fourier"])
@pytest.mark.parametrize(("degrees", "low"), [(30, 180), (60, 30), (120, 20)])
def test_nothing_is_less_than_air(degrees, low, solver):
    """Values below air beside water that is too low are what fits where directions are missing."""
    sinogram, A = limited(degrees)
    image = reconstruct(sinogram, A, TotalVariation(0.05), solver=solver)
    assert float(image.min()) >= 0
    assert float(image.max()) < 1.6
    x, y = torch.from_numpy(GRID.x), torch.from_numpy(GRID.y)[:, None]
    assert abs(1000 * float(image[(x + 10) ** 2 + y**2 < 15**2].mean() - 1)) < low


def test_what_is_negative_may_be_taken_away_after_the_denoiser():
    """That is the proximal map of total variation over images without negative values."""
    _, A = limited(30)
    chance = torch.Generator().manual_seed(3)
    noisy = torch.randn(GRID.shape, generator=chance)
    strength, total_variation = 0.3, TotalVariation(0.3, tolerance=1e-5)

    def minimised(image: torch.Tensor) -> float:
        rows, cols = torch.zeros_like(image), torch.zeros_like(image)
        rows[:-1], cols[:, :-1] = image.diff(dim=0), image.diff(dim=1)
        return float((image - noisy).square().sum() / 2 + strength * torch.hypot(rows, cols).sum())

    answer = possible(total_variation, A)(noisy)
    for size in (0.3, 0.03, 0.01):
        other = (answer + size * torch.randn(GRID.shape, generator=chance)).clamp(min=0)
        assert minimised(answer) < minimised(other)
    assert minimised(answer) < minimised(total_variation(noisy.clamp(min=0)))


def test_a_full_rotation_is_left_to_the_data():
    _, A = limited(358)
    denoise = TotalVariation(0.05)
    assert possible(denoise, A) is denoise


@pytest.mark.parametrize("denoise", [lambda image: 4 * image, lambda image: image / 0], ids=["growing", "not finite"])
def test_divergence_is_said_in_one_sentence(denoise):
    sinogram, A = limited(90)
    assert bool(fbp(sinogram.line_integrals, A).isfinite().all())
    with pytest.raises(ValueError, match="ADMM needs iterates that stay bounded, but in iteration"):
        reconstruct(sinogram, A, denoise, iterations=60, stop="never")
