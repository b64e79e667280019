import pytest
import torch

from pnpct.denoisers.quadratic import Quadratic


def test_it_is_the_minimiser_of_the_penalised_distance(generator):
    noisy = torch.rand(12, 9, generator=generator, dtype=torch.float64)
    smooth = Quadratic(3.0)(noisy)

    def objective(v: torch.Tensor) -> torch.Tensor:
        penalty = v.diff(dim=0).square().sum() + v.diff(dim=1).square().sum()
        return (v - noisy).square().sum() / 2 + 1.5 * penalty

    v = smooth.clone().requires_grad_()
    (gradient,) = torch.autograd.grad(objective(v), v)
    assert gradient.abs().max() < 1e-12


def test_strength_0_changes_nothing_and_the_mean_stays(generator):
    images = torch.rand(2, 8, 8, generator=generator)
    torch.testing.assert_close(Quadratic(0.0)(images), images)
    torch.testing.assert_close(Quadratic(50.0)(images).mean((1, 2)), images.mean((1, 2)))


def test_a_batch_is_its_slices(generator):
    images = torch.rand(3, 8, 6, generator=generator)
    torch.testing.assert_close(Quadratic(2.0)(images), torch.stack([Quadratic(2.0)(image) for image in images]))


@pytest.mark.parametrize("strength", [-1.0, float("nan")])
def test_a_strength_that_cannot_be_is_refused(strength):
    with pytest.raises(ValueError, match="pixels² from 0 up"):
        Quadratic(strength)
