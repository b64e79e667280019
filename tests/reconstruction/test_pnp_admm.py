import itertools
from dataclasses import replace
from inspect import unwrap

import pytest
import torch

from pnpct.denoisers import TotalVariation, total_variation
from pnpct.geometry import FanBeam, ImageGrid, evenly_spaced_views
from pnpct.operators import Projector
from pnpct.physics import BandedWeights, DiagonalWeights, Scan, Sinogram, simulate_counts, take_log
from pnpct.reconstruction import (
    TVPWLS,
    ADMMState,
    change,
    fbp,
    mean_diagonal,
    paper_rule,
    pnp_admm,
    reconstruct,
    relative_rule,
    solver_by_name,
    until,
)
from pnpct.reconstruction.normal_equations import balanced_sigma_v
from pnpct.reconstruction.one_step import normal_matrix

DIMS = (-2, -1)


@pytest.fixture(scope="module")
def A(grid: ImageGrid, geometry: FanBeam) -> Projector:
    return Projector(grid, geometry)


@pytest.fixture(scope="module")
def sinogram(A: Projector, disk: torch.Tensor) -> Sinogram:
    incident = torch.tensor(2e4)
    counts = simulate_counts(A(disk), incident, electronic_noise=5.0, generator=torch.Generator().manual_seed(3))
    return take_log(Scan(counts, incident, 5.0, geometry=A.geometry, mu_water=A.mu_water))


@pytest.fixture(scope="module")
def start(sinogram: Sinogram, A: Projector) -> ADMMState:
    return ADMMState.start(fbp(sinogram.line_integrals, A, kernel="soft"))


def nth(states, number: int) -> ADMMState:
    return next(itertools.islice(states, number - 1, None))


def balanced(sinogram: Sinogram, A: Projector, beta: float) -> float:
    """σ_v for a penalty of β mean diagonals of AᵀWA, HU."""
    return balanced_sigma_v(sinogram, A) / beta**0.5


def rms_hu(image: torch.Tensor) -> float:
    return 1000 * float(image.square().mean().sqrt())


def test_without_a_denoiser_the_iteration_is_weighted_least_squares(generator):
    """With v = x the only fixed point solves AᵀWA x = AᵀW y."""
    grid = ImageGrid(16, 16, spacing=16.0)
    A = Projector(
        grid,
        FanBeam(evenly_spaced_views(90), 96, source_to_isocenter=541.0, source_to_detector=949.0, bin_width=6.0),
    )
    y = A(torch.rand(grid.shape, generator=generator)) + 0.01 * torch.randn(A.range_shape, generator=generator)
    weights = 1 + torch.rand(A.range_shape, generator=generator)
    sinogram = Sinogram(y, DiagonalWeights(weights))
    right = A.T(weights * y).double().flatten()
    exact = torch.linalg.solve(normal_matrix(sinogram, A), right).reshape(grid.shape).float()
    start = ADMMState.start(torch.zeros(grid.shape))
    sigma_v = balanced(sinogram, A, 0.01)
    last = nth(pnp_admm(sinogram, A, lambda image: image, start, sigma_v=sigma_v), 100)
    assert float((last.v - exact).norm() / exact.norm()) < 1e-4


@pytest.mark.slow
def test_the_data_step_at_64_equals_dense_cholesky(generator):
    grid = ImageGrid(64, 64, spacing=4.0)
    A = Projector(
        grid,
        FanBeam(evenly_spaced_views(90), 96, source_to_isocenter=541.0, source_to_detector=949.0, bin_width=6.0),
    )
    y = A(torch.rand(grid.shape, generator=generator))
    sinogram = Sinogram(y, DiagonalWeights(1 + torch.rand(A.range_shape, generator=generator)))
    start = ADMMState.start(torch.zeros(grid.shape))
    sigma_v = balanced_sigma_v(sinogram, A)
    dense, many = solver_by_name("dense-cholesky"), solver_by_name("fourier", inner_iterations=40)
    exact = nth(pnp_admm(sinogram, A, lambda v: v, start, sigma_v=sigma_v, solver=dense), 1).x
    iterated = nth(pnp_admm(sinogram, A, lambda v: v, start, sigma_v=sigma_v, solver=many), 1).x
    assert float((iterated - exact).norm() / exact.norm()) < 1e-4


@pytest.mark.parametrize("solver", ["fourier", "cholesky", "cg"])
@pytest.mark.parametrize("sigma_v", [20.0, 45.0])
def test_iterative_solvers_arrive_at_the_exact_solution(sinogram, A, start, solver, sigma_v):
    dense, many = solver_by_name("dense-cholesky"), solver_by_name(solver, inner_iterations=80)
    exact = nth(pnp_admm(sinogram, A, lambda v: v, start, sigma_v=sigma_v, solver=dense), 1)
    assert rms_hu(nth(pnp_admm(sinogram, A, lambda v: v, start, sigma_v=sigma_v, solver=many), 1).x - exact.x) < 0.05


@pytest.mark.parametrize("solver", ["fourier", "cholesky"])
def test_preconditioners_save_iterations(sinogram, A, start, solver):
    sigma_v = balanced(sinogram, A, 0.3)
    dense = solver_by_name("dense-cholesky")
    exact = nth(pnp_admm(sinogram, A, lambda v: v, start, sigma_v=sigma_v, solver=dense), 1).x

    def error(name):
        make = solver_by_name(name, inner_iterations=5)
        return rms_hu(nth(pnp_admm(sinogram, A, lambda v: v, start, sigma_v=sigma_v, solver=make), 1).x - exact)

    assert error(solver) < 0.6 * error("cg")


def test_the_one_step_blend_is_what_the_paper_writes(sinogram, A, start):
    beta = 1.2
    blend, sigma_v = solver_by_name("fbp-blend"), balanced(sinogram, A, beta)
    state = nth(pnp_admm(sinogram, A, lambda v: v, start, sigma_v=sigma_v, solver=blend), 1)
    expected = (fbp(sinogram.line_integrals, A) + beta * start.v) / (1 + beta)
    torch.testing.assert_close(state.x, expected, rtol=1e-4, atol=1e-4)


@pytest.fixture(scope="module")
def best(sinogram, A, start):
    """By TV-PWLS, after enough iterations."""
    return nth(TVPWLS(1.5).states(sinogram, A, start), 60).v


def test_a_convex_prior_leads_to_the_same_image_for_every_sigma_v(sinogram, A, start, best):
    """It depends on λ = strength / σ_v² alone, and TV-PWLS has 1.5 / σ, σ the σ_v of the balance."""
    sigma_v = balanced(sinogram, A, 2.0)
    denoise = TotalVariation(1.5 / float(balanced(sinogram, A, 1.0)) * float(sigma_v) ** 2 / 1000)
    loop = nth(pnp_admm(sinogram, A, denoise, start, sigma_v=sigma_v), 60).v
    assert rms_hu(loop - best) < 0.5


def test_tv_pwls_arrives_at_a_minimum(sinogram, A, best, generator):
    def objective(image: torch.Tensor) -> float:
        misfit = A(image).double() - sinogram.line_integrals
        data = (sinogram.weights.diagonal * misfit.square()).sum() / 2
        return float(data + 1.5 / float(balanced_sigma_v(sinogram, A)) * 1000 * total_variation(image.double()))  # HU

    for _ in range(20):
        step = 0.01 * torch.randn(best.shape, generator=generator)
        assert objective(best + step) > objective(best)
        assert objective(best + 0.1 * step) > objective(best)
    assert objective(best * 1.001) > objective(best)
    assert objective(best * 0.999) > objective(best)


def test_resuming_gives_the_same_iterates(sinogram, A, start):
    denoise = TotalVariation(0.05)
    straight = nth(pnp_admm(sinogram, A, denoise, start), 6)
    resumed = nth(pnp_admm(sinogram, A, denoise, nth(pnp_admm(sinogram, A, denoise, start), 3)), 3)
    for one, other in zip((straight.x, straight.v, straight.u), (resumed.x, resumed.v, resumed.u), strict=True):
        torch.testing.assert_close(one, other, rtol=0, atol=2e-4)  # rounding: 0.2 HU


def test_a_batch_is_its_slices(sinogram, A, start):
    y, weights = sinogram.line_integrals, sinogram.weights.diagonal
    both = Sinogram(torch.stack([y, 0.8 * y]), DiagonalWeights(torch.stack([weights, 3 * weights])))
    second = Sinogram(0.8 * y, DiagonalWeights(3 * weights))
    begin = torch.stack([start.x, 0.8 * start.x])
    together = nth(pnp_admm(both, A, TotalVariation(0.05), ADMMState.start(begin)), 4).v
    alone = nth(pnp_admm(second, A, TotalVariation(0.05), ADMMState.start(begin[1])), 4).v
    # The levels of the preconditioner are chosen for the whole batch.
    assert rms_hu(together[1] - alone) < 2.0


def test_pnp_beats_fbp(sinogram, A, disk):
    images = [fbp(sinogram.line_integrals, A, kernel=kernel) for kernel in ("ram-lak", "hann", "soft")]
    best = min(rms_hu(image - disk) for image in images)
    assert rms_hu(reconstruct(sinogram, A, TotalVariation(0.1)) - disk) < 0.8 * best


def test_the_penalty_is_one_over_the_square_of_sigma_v(sinogram, A, start):
    """Of the normal equations, in the units of AᵀWA, which are 1 over HU/1000 squared."""
    moved = ADMMState(start.x, start.v + 0.01, start.u)
    dense = solver_by_name("dense-cholesky")
    x, other = (nth(pnp_admm(sinogram, A, lambda v: v, of, sigma_v=80.0, solver=dense), 1).x for of in (start, moved))
    step = other - x
    pulled = A.T(sinogram.weights(A(step)))
    torch.testing.assert_close(pulled, (1000 / 80.0) ** 2 * (0.01 - step), rtol=1e-2, atol=1e-2)


def test_correlated_noise_has_its_weights_in_the_loop(sinogram, A, start):
    variance = 1 / sinogram.weights.diagonal
    independent = BandedWeights(torch.stack([variance, torch.zeros_like(variance)], dim=1))
    correlated = BandedWeights(torch.stack([variance, 0.4 * variance.roll(-1, -1).minimum(variance)], dim=1))
    y, denoise = sinogram.line_integrals, TotalVariation(0.05)
    diagonal = nth(pnp_admm(sinogram, A, denoise, start), 3).v
    assert rms_hu(nth(pnp_admm(Sinogram(y, independent), A, denoise, start), 3).v - diagonal) < 0.1
    assert rms_hu(nth(pnp_admm(Sinogram(y, correlated), A, denoise, start), 3).v - diagonal) > 1.0


def test_a_moving_focal_spot_is_reconstructed(disk, grid, geometry, generator):
    moving = replace(geometry, focal_spot_shifts=[(1.5 * (view % 2), 0.0) for view in range(geometry.views)])
    A = Projector(grid, moving)
    sinogram = Sinogram(A(disk), DiagonalWeights(torch.ones(moving.shape)))
    zero, sigma_v = ADMMState.start(torch.zeros(grid.shape)), balanced(sinogram, A, 0.05)
    state = nth(pnp_admm(sinogram, A, lambda v: v, zero, sigma_v=sigma_v), 30)
    assert rms_hu(state.x - disk) < 10


def test_the_papers_rule_is_a_mean_square_in_units_of_water(start):
    moved = ADMMState(start.x + 0.01, start.v + 0.01, start.u + 0.01)
    assert float(change(start, moved, DIMS)) == pytest.approx(1e-4, rel=1e-3)
    assert paper_rule(start, ADMMState(start.x + 0.0099, start.v, start.u), DIMS)
    assert not paper_rule(start, ADMMState(start.x + 0.0101, start.v + 0.0101, start.u + 0.0101), DIMS)


def test_the_relative_rule_wants_rest_and_agreement(start):
    assert relative_rule(start, start, DIMS)
    assert not relative_rule(start, ADMMState(start.x + 0.01, start.v, start.u), DIMS)
    apart = ADMMState(start.x, start.v + 0.003, start.u)
    assert not relative_rule(apart, apart, DIMS)


def test_until_stops_by_rule_or_by_count(sinogram, A, start):
    states = pnp_admm(sinogram, A, TotalVariation(0.05), start)
    assert len(list(until(states, start, A, iterations=3, stop="never"))) == 3
    states = pnp_admm(sinogram, A, TotalVariation(0.05), start)
    stopped = list(until(states, start, A, iterations=100, stop="paper"))
    assert len(stopped) < 20
    assert paper_rule(stopped[-2], stopped[-1], A.domain_dims)


@pytest.mark.parametrize("damping", [0.25, 1.0])
def test_damped_x_and_v_are_held_together_by_the_penalty_over_the_damping(sinogram, A, start, damping):
    """In the limit ½ ‖A x − y‖²_W + λ R(v) + β / (2 damping) ‖x − v‖² is least: its gradient in x is zero."""
    sigma_v = balanced(sinogram, A, 1.0)
    limit = nth(pnp_admm(sinogram, A, TotalVariation(0.05), start, sigma_v=sigma_v, damping=damping), 101)
    pulled = A.T(sinogram.weights(A(limit.x) - sinogram.line_integrals)) / mean_diagonal(sinogram, A)
    held = (limit.x - limit.v) / damping
    assert rms_hu(held) > 5.0
    torch.testing.assert_close(pulled, -held, rtol=0, atol=0.05 * float(held.abs().max()))


def test_damped_entirely_admm_has_no_memory(sinogram, A, start):
    states = pnp_admm(sinogram, A, TotalVariation(0.05), start, damping=1.0)
    assert all(not state.u.any() for state in itertools.islice(states, 3))


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda s, A, start: next(pnp_admm(s, A, lambda v: v, start, sigma_v=0.0)), "a positive number of HU, got 0"),
        (
            lambda s, A, start: next(until(iter([]), start, A, iterations=0, stop="never")),
            "at least one iteration, got 0",
        ),
        (
            lambda s, A, start: next(unwrap(until)(iter([]), start, A, iterations=1, stop="soon")),
            'no stopping rule "soon"; the rules are relative, paper, never',
        ),
        (lambda s, A, start: solver_by_name("lu"), 'no solver "lu"; the solvers are fourier, cholesky'),
        (lambda s, A, start: solver_by_name("fbp-blend", inner_iterations=2), "takes no inner iterations"),
        (lambda s, A, start: solver_by_name("cg", inner_iterations=0), "at least one inner iteration"),
    ],
)
def test_impossible_requests_are_refused(sinogram, A, start, call, words):
    with pytest.raises(ValueError, match=words):
        call(sinogram, A, start)


def test_dense_cholesky_refuses_what_it_cannot_hold(sinogram, geometry):
    big = Projector(ImageGrid(200, 200, spacing=1.0), geometry)
    with pytest.raises(ValueError, match="at most 16384 pixels, got 200 x 200"):
        next(
            pnp_admm(
                sinogram,
                big,
                lambda v: v,
                ADMMState.start(torch.zeros(200, 200)),
                solver=solver_by_name("dense-cholesky"),
            )
        )
