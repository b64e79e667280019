"""Conjugate gradients on a diagonal operator, whose solution is known."""

import pytest
import torch

from pnpct.arrays import Image
from pnpct.operators import LinearOperator
from pnpct.physics import DiagonalWeights, Sinogram
from pnpct.reconstruction.normal_equations import (
    GRADIENT_TOLERANCE,
    INNER_ITERATIONS,
    MOST_INNER_ITERATIONS,
    TOLERANCE,
    conjugate_gradient,
    warm_started,
)


class Diagonal(LinearOperator):
    """An operator that counts how often it is applied; each row of an image has a spectrum of its own."""

    def __init__(self, spectrum: torch.Tensor) -> None:
        self.spectrum, self.products = spectrum, 0
        self.domain_shape = self.range_shape = (8, 8)

    def forward(self, x: Image) -> Image:
        self.products += 1
        return self.spectrum * x

    adjoint = forward


@pytest.fixture
def hard() -> Diagonal:
    return Diagonal(torch.logspace(0, 2, 64, dtype=torch.float64).reshape(8, 8))


def residual(H: Diagonal, b: Image, x: Image) -> float:
    return float((b - H.spectrum * x).norm() / b.norm())


def test_steps_go_on_while_the_residual_is_too_large(hard: Diagonal) -> None:
    b = torch.ones(8, 8, dtype=torch.float64)
    x = torch.zeros_like(b)
    few, _ = conjugate_gradient(hard, b, x, x, iterations=3)
    assert hard.products == 3
    assert residual(hard, b, few) > 0.1
    enough, Hx = conjugate_gradient(hard, b, x, x, iterations=3, most=200, tolerance=1e-3)
    assert residual(hard, b, enough) < 1e-3
    assert 10 < hard.products - 3 < 100
    torch.testing.assert_close(Hx, hard.spectrum * enough)


def of_noise(share: float) -> Sinogram:
    """Line integrals with noise that is this share of them."""
    weights = torch.full((8, 8), share**-2, dtype=torch.float64)
    return Sinogram(torch.ones(8, 8, dtype=torch.float64), DiagonalWeights(weights))


NOISE = 0.02


def test_a_start_that_is_good_enough_takes_the_least_steps_and_a_bad_one_not_more_than_the_most(hard: Diagonal) -> None:
    b, none = torch.ones(8, 8, dtype=torch.float64), torch.zeros(1, 1, dtype=torch.float64)
    exact = b / hard.spectrum
    A = Diagonal(hard.spectrum.sqrt() * NOISE)
    x = warm_started(of_noise(NOISE), A, INNER_ITERATIONS)(b, none, exact * (1 + 1e-6))
    assert A.products == 2 * (1 + INNER_ITERATIONS)  # the first is H of the start
    assert residual(hard, b, x) < 2e-6
    A, harder = Diagonal(hard.spectrum**1.5 * NOISE), Diagonal(hard.spectrum**3)
    x = warm_started(of_noise(NOISE), A, INNER_ITERATIONS)(b, none, torch.zeros_like(b))
    assert A.products == 2 * (1 + MOST_INNER_ITERATIONS)
    assert residual(harder, b, x) > TOLERANCE * NOISE


def test_an_image_of_little_noise_is_solved_more_exactly(hard: Diagonal) -> None:
    b, none = torch.ones(8, 8, dtype=torch.float64), torch.zeros(1, 1, dtype=torch.float64)
    easier, products = Diagonal(hard.spectrum.sqrt()), []
    for noise in (0.2, 0.02):
        A = Diagonal(easier.spectrum.sqrt() * noise)
        x = warm_started(of_noise(noise), A, 1)(b, none, torch.zeros_like(b))
        assert 0.1 < residual(easier, b, x) / (TOLERANCE * noise) < 1
        products.append(A.products)
    assert products[0] < products[1]


def test_what_it_answered_last_costs_no_product_whatever_the_penalty(hard: Diagonal) -> None:
    b, penalty = torch.ones(8, 8, dtype=torch.float64), torch.full((1, 1), 5.0, dtype=torch.float64)
    A = Diagonal(hard.spectrum.sqrt() * NOISE)
    solve = warm_started(of_noise(NOISE), A, INNER_ITERATIONS)
    x = solve(b, penalty, b / (hard.spectrum + 5.0))
    A.products = 0
    other = solve(b, 2 * penalty, x)
    assert A.products % 2 == 0
    assert residual(Diagonal(hard.spectrum + 10.0), b, other) < TOLERANCE * NOISE
    again = warm_started(of_noise(NOISE), A, INNER_ITERATIONS)
    first = A.products
    torch.testing.assert_close(again(b, 2 * penalty, x), other)
    assert A.products - first == first + 2


def test_each_image_of_a_batch_stops_on_its_own() -> None:
    easy, hard = torch.full((8, 8), 2.0, dtype=torch.float64), torch.logspace(0, 2, 64, dtype=torch.float64)
    both = Diagonal(torch.stack([easy, hard.reshape(8, 8)]))
    b = torch.ones(2, 8, 8, dtype=torch.float64)
    zero = torch.zeros_like(b)
    together, _ = conjugate_gradient(both, b, zero, zero, iterations=1, most=50, tolerance=1e-3)
    for number in range(2):
        H = Diagonal(both.spectrum[number])
        alone, _ = conjugate_gradient(H, b[number], zero[number], zero[number], iterations=1, most=50, tolerance=1e-3)
        torch.testing.assert_close(together[number], alone)


def test_the_gradient_of_a_solution_is_a_solution_of_the_same_equations(hard: Diagonal) -> None:
    b, penalty = torch.ones(8, 8, dtype=torch.float64), torch.full((1, 1), 40.0, dtype=torch.float64)
    A = Diagonal(hard.spectrum.sqrt() * NOISE)
    solve = warm_started(of_noise(NOISE), A, INNER_ITERATIONS)
    right = b.clone().requires_grad_()
    x = solve(right, penalty, torch.zeros_like(b))
    assert solve(b, penalty, x.detach()).requires_grad is False
    downhill = torch.linspace(1, 2, 64, dtype=torch.float64).reshape(8, 8)
    (x * downhill).sum().backward()
    assert right.grad is not None
    assert residual(Diagonal(hard.spectrum + 40.0), downhill, right.grad) < GRADIENT_TOLERANCE
