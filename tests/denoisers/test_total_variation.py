import math

import pytest
import torch
from skimage.restoration import denoise_tv_chambolle

from pnpct.denoisers import TotalVariation, total_variation


@pytest.fixture
def noisy(disk: torch.Tensor, generator: torch.Generator) -> torch.Tensor:
    return disk + 0.05 * torch.randn(disk.shape, generator=generator)


def objective(v: torch.Tensor, z: torch.Tensor, strength: float) -> torch.Tensor:
    return 0.5 * (v - z).double().square().sum() + strength * total_variation(v.double())


def test_the_value_of_a_straight_edge_is_its_height_times_its_length() -> None:
    image = torch.zeros(3, 7, 9)
    image[1, :, 4:] = 0.5
    image[2, 3:, :] = 2.0
    torch.testing.assert_close(total_variation(image), torch.tensor([0.0, 3.5, 18.0]))


def test_the_value_is_isotropic_at_a_corner() -> None:
    image = torch.zeros(4, 4)
    image[1, 1] = 1.0
    # Forward differences: two edges of length 1 and, at the pixel itself, one of √2.
    assert total_variation(image).item() == pytest.approx(2 + math.sqrt(2))


@pytest.mark.parametrize("strength", [0.01, 0.05, 0.1])
def test_scikit_image_agrees(noisy: torch.Tensor, strength: float) -> None:
    result = TotalVariation(strength, iterations=1500, tolerance=1e-5)(noisy)
    # Its iteration is the older one, for the same minimiser, and slow where the strength is large.
    expected = denoise_tv_chambolle(noisy.double().numpy(), weight=strength, eps=0, max_num_iter=4000)
    torch.testing.assert_close(result.double(), torch.from_numpy(expected), rtol=0, atol=2e-3)
    assert objective(result, noisy, strength) <= objective(torch.from_numpy(expected), noisy, strength) * (1 + 1e-5)


def test_no_nearby_image_has_a_lower_objective(noisy: torch.Tensor, generator: torch.Generator) -> None:
    strength = 0.05
    best = TotalVariation(strength, iterations=2000, tolerance=1e-6)(noisy.double())
    for size in (1e-1, 1e-2, 1e-3):
        step = size * torch.randn(best.shape, generator=generator, dtype=torch.float64)
        assert objective(best + step, noisy, strength) > objective(best, noisy, strength)


@pytest.mark.parametrize("tolerance", [1e-2, 1e-3, 1e-4])
def test_the_distance_from_the_minimiser_is_within_the_tolerance(noisy: torch.Tensor, tolerance: float) -> None:
    exact = TotalVariation(0.05, iterations=3000, tolerance=1e-6)(noisy.double())
    result = TotalVariation(0.05, iterations=3000, tolerance=tolerance)(noisy)
    assert (result - exact).square().mean().sqrt() <= tolerance


def test_more_iterations_come_closer(noisy: torch.Tensor) -> None:
    values = [
        objective(TotalVariation(0.1, iterations=iterations, tolerance=1e-9)(noisy), noisy, 0.1)
        for iterations in (5, 20, 80)
    ]
    assert values[0] > values[1] > values[2]


def test_a_disc_loses_twice_the_strength_over_its_radius() -> None:
    x = torch.arange(128.0) - 63.5
    radius, strength = 30.0, 1.5
    disc = (x[None, :] ** 2 + x[:, None] ** 2 < radius**2).double()
    result = TotalVariation(strength, iterations=2000)(disc)
    assert result[64, 64].item() == pytest.approx(1 - 2 * strength / radius, abs=0.01)


def test_a_constant_image_stays(generator: torch.Generator) -> None:
    image = torch.full((9, 11), 1.04)
    torch.testing.assert_close(TotalVariation(0.1)(image), image)


def test_the_mean_stays(noisy: torch.Tensor) -> None:
    assert TotalVariation(0.3)(noisy).mean().item() == pytest.approx(noisy.mean().item(), abs=1e-6)


def test_a_large_strength_leaves_only_the_mean(noisy: torch.Tensor) -> None:
    result = TotalVariation(1e3, iterations=5000)(noisy)
    torch.testing.assert_close(result, torch.full_like(noisy, noisy.mean().item()), rtol=0, atol=1e-2)


def test_strength_0_changes_nothing_and_shares_no_memory(noisy: torch.Tensor) -> None:
    result = TotalVariation(0.0)(noisy)
    assert torch.equal(result, noisy)
    assert result.data_ptr() != noisy.data_ptr()


def test_the_input_is_left_alone(noisy: torch.Tensor) -> None:
    before = noisy.clone()
    TotalVariation(0.05)(noisy)
    assert torch.equal(noisy, before)


def test_a_batch_is_its_slices(noisy: torch.Tensor) -> None:
    denoise = TotalVariation(0.05, iterations=300)
    # A flat image stops at the first check, the others later, each at its own time.
    batch = torch.stack([noisy, torch.ones_like(noisy), 0.2 * noisy, noisy.flip(0)]).reshape(2, 2, *noisy.shape)
    slices = torch.stack([denoise(one) for one in batch.flatten(0, 1)]).reshape(batch.shape)
    torch.testing.assert_close(denoise(batch), slices, rtol=0, atol=1e-6)


def test_scikit_image_agrees_over_three_axes(noisy: torch.Tensor, generator: torch.Generator) -> None:
    volume = noisy + 0.1 * torch.randn(5, *noisy.shape, generator=generator)
    volume[3:] += 0.5  # an edge between slices
    theirs = torch.from_numpy(denoise_tv_chambolle(volume.double().numpy(), weight=0.1, eps=0, max_num_iter=3000))
    ours = TotalVariation(0.1, iterations=1500, tolerance=1e-5, across=1.0)(volume)
    torch.testing.assert_close(ours.double(), theirs, rtol=0, atol=2e-3)


def test_a_volume_in_slices_twice_as_far_apart_has_half_the_gradient_along_z() -> None:
    step = torch.zeros(4, 3, 3)
    step[2:] = 1.0
    for across in (1.0, 0.5):  # each half moves by strength · across / 2 slices
        moved = TotalVariation(0.1, iterations=2000, tolerance=1e-6, across=across)(step)
        torch.testing.assert_close(moved, step + across * 0.05 * (1 - 2 * step), rtol=0, atol=1e-4)


def test_volumes_of_a_batch_and_images_without_slices_are_apart(noisy: torch.Tensor) -> None:
    volumes = torch.stack([torch.stack([noisy, noisy.flip(0)]), torch.ones(2, *noisy.shape)])
    denoise = TotalVariation(0.05, across=1.0)
    torch.testing.assert_close(denoise(volumes), torch.stack([denoise(one) for one in volumes]), rtol=0, atol=1e-6)
    assert torch.equal(denoise(noisy), TotalVariation(0.05)(noisy))


def test_a_negative_weight_across_slices_is_refused() -> None:
    with pytest.raises(ValueError, match="between slices"):
        TotalVariation(0.05, across=-1.0)


def test_columns_and_rows_of_one_pixel_are_allowed() -> None:
    line = torch.tensor([[0.0, 0.0, 1.0, 1.0]])
    expected = torch.tensor([[0.05, 0.05, 0.95, 0.95]])
    denoise = TotalVariation(0.1, iterations=1000, tolerance=1e-5)
    torch.testing.assert_close(denoise(line), expected, rtol=0, atol=1e-4)
    torch.testing.assert_close(denoise(line.mT), expected.mT, rtol=0, atol=1e-4)


@pytest.mark.parametrize("strength", [-0.1, math.nan, math.inf])
def test_a_strength_that_is_none_is_refused(strength: float) -> None:
    with pytest.raises(ValueError, match="strength"):
        TotalVariation(strength)


def test_no_iterations_and_no_tolerance_are_refused() -> None:
    with pytest.raises(ValueError, match="at least one iteration"):
        TotalVariation(0.1, iterations=0)
    with pytest.raises(ValueError, match="tolerance"):
        TotalVariation(0.1, tolerance=0.0)
