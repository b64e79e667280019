import math
from collections.abc import Callable
from functools import partial

import pytest
import torch
from scipy.optimize import minimize_scalar

from pnpct.training import (
    contrast_loss,
    mean_squared_error,
    ssim_loss,
    stage_one_loss,
    stage_two_loss,
    texture_loss,
)
from pnpct.training.local_statistics import local_entropy, ssim_map, uniform_taps
from pnpct.training.losses import soft_tissue_weight

CORRECTED = [mean_squared_error, ssim_loss, texture_loss, contrast_loss, stage_one_loss, stage_two_loss]
AS_PRINTED = [partial(loss, form="paper") for loss in (texture_loss, contrast_loss, stage_two_loss)]


def name_of(loss) -> str:
    return f"{loss.func.__name__}-paper" if isinstance(loss, partial) else loss.__name__


@pytest.fixture
def noise(generator: torch.Generator) -> torch.Tensor:
    """Noise of variance 1, three times over."""
    return torch.randn(3, 48, 48, generator=generator, dtype=torch.float64)


def best(loss_of: Callable[[float], torch.Tensor], low: float, high: float) -> float:
    found = minimize_scalar(lambda value: loss_of(value).item(), bounds=(low, high), options={"xatol": 1e-6})
    return float(found.x)


@pytest.mark.parametrize("loss", [*CORRECTED, *AS_PRINTED], ids=name_of)
def test_the_gradient_is_that_of_finite_differences(loss, generator: torch.Generator) -> None:
    images = 1.04 + 0.03 * torch.randn(2, 2, 12, 13, generator=generator, dtype=torch.float64)
    # More texture in the target, so that the output lacks some.
    output, target = images[0].requires_grad_(True), 1 + 2 * (images[1] - 1)
    direction = torch.randn(output.shape, generator=generator, dtype=torch.float64)
    (gradient,) = torch.autograd.grad(loss(output, target), output)
    step = 1e-6
    with torch.no_grad():
        difference = loss(output + step * direction, target) - loss(output - step * direction, target)
    slope = (gradient * direction).sum()
    assert abs(slope) > 0
    torch.testing.assert_close(difference / (2 * step), slope, rtol=1e-5, atol=0)


@pytest.mark.parametrize("loss", CORRECTED, ids=name_of)
def test_an_output_equal_to_its_target_costs_nothing_and_others_something(loss, noise: torch.Tensor) -> None:
    image = 1 + 0.02 * noise
    assert loss(image, image).item() == pytest.approx(0, abs=1e-12)
    assert loss(1 + 0.01 * noise, image) > 1e-8


@pytest.mark.parametrize(
    "loss", [mean_squared_error, ssim_loss, texture_loss, stage_one_loss, *AS_PRINTED], ids=name_of
)
def test_a_batch_costs_the_mean_of_its_images(loss, noise: torch.Tensor) -> None:
    output, target = 1 + 0.02 * noise[:2], 1 + 0.03 * noise[1:]
    of_each = torch.stack([loss(one, other) for one, other in zip(output, target, strict=True)])
    torch.testing.assert_close(loss(output, target), of_each.mean())


@pytest.mark.parametrize("loss", CORRECTED, ids=name_of)
def test_shapes_that_only_broadcast_are_refused(loss) -> None:
    with pytest.raises(ValueError, match="must have one shape"):
        loss(torch.ones(2, 16, 16), torch.ones(16, 16))


# Texture


@pytest.mark.parametrize("weight", [1e-5, 1e-4, 1e-3])
def test_maximal_entropy_leaves_noise_of_root_half_its_weight(weight: float, noise: torch.Tensor) -> None:
    entropy = partial(local_entropy, floor_hu=1e-3)
    truth = torch.ones_like(noise[0])
    noise = noise[0] / noise[0].square().mean().sqrt()

    def loss(deviation: float) -> torch.Tensor:
        output = truth + deviation * noise
        return mean_squared_error(output, truth) + weight * texture_loss(output, truth, form="paper", entropy=entropy)

    assert best(loss, 1e-4, 0.1) == pytest.approx(math.sqrt(weight / 2), rel=1e-3)


@pytest.mark.parametrize(("weight", "expected_hu"), [(1e-5, 2.2), (1e-4, 7.1), (1e-3, 10.0), (1e-2, 10.0)])
def test_matched_entropy_leaves_no_more_noise_than_the_target_has(
    weight: float, expected_hu: float, noise: torch.Tensor
) -> None:
    truth = torch.ones_like(noise[0])
    target = truth + 0.01 * noise[1]

    def loss(deviation: float) -> torch.Tensor:
        output = truth + deviation * noise[0]
        return mean_squared_error(output, target) + weight * texture_loss(output, target)

    # In some windows the output is by chance less varied than its target is there.
    assert 1000 * best(loss, 1e-4, 0.1) == pytest.approx(expected_hu, rel=0.25)


def test_matched_entropy_asks_for_nothing_where_the_target_has_less(noise: torch.Tensor) -> None:
    assert texture_loss(1 + 0.02 * noise[0], 1 + 0.01 * noise[1]).item() == pytest.approx(0, abs=1e-3)
    assert texture_loss(1 + 0.01 * noise[0], 1 + 0.02 * noise[1]).item() == pytest.approx(math.log(2), abs=0.1)


def test_the_printed_texture_term_does_not_look_at_the_target(noise: torch.Tensor) -> None:
    output = 1 + 0.02 * noise[0]
    with_one, with_other = (texture_loss(output, target, form="paper") for target in (output, 1 + 0.5 * noise[1]))
    assert with_one == with_other == -local_entropy(output).mean()


# Structural similarity and contrast


def gain_preferred(loss, signal: torch.Tensor, target: torch.Tensor) -> float:
    return best(lambda gain: loss(1 + gain * signal, target), 0.2, 5.0)


@pytest.mark.parametrize(("signal_hu", "noise_hu"), [(30.0, 10.0), (30.0, 30.0), (30.0, 60.0)])
@pytest.mark.parametrize("data_range_hu", [400.0, 2000.0])
def test_similarity_to_a_noisy_target_asks_for_more_contrast_than_there_is(
    signal_hu: float, noise_hu: float, data_range_hu: float, generator: torch.Generator
) -> None:
    fields = torch.randn(2, 150, 150, generator=generator, dtype=torch.float64)
    signal, noise = signal_hu / 1000 * fields[0], noise_hu / 1000 * fields[1]
    noise -= signal * (signal * noise).sum() / signal.square().sum()  # by chance they would agree a little
    target = 1 + signal + noise
    assert gain_preferred(mean_squared_error, signal, target) == pytest.approx(1, abs=1e-4)
    s2, n2, c2 = (signal_hu / 1000) ** 2, (noise_hu / 1000) ** 2, (0.03 * data_range_hu / 1000) ** 2
    gain = (-c2 + math.sqrt(c2**2 + 4 * s2 * (s2 + n2 + c2))) / (2 * s2)
    loss = partial(ssim_loss, data_range_hu=data_range_hu, taps=uniform_taps(15))
    assert gain_preferred(loss, signal, target) == pytest.approx(gain, rel=0.03)


@pytest.mark.parametrize(("signal_hu", "noise_hu"), [(3.0, 60.0), (30.0, 60.0), (30.0, 200.0)])
def test_the_weight_of_similarity_in_stage_one_keeps_contrast_within_a_hundredth(
    signal_hu: float, noise_hu: float, noise: torch.Tensor
) -> None:
    signal, noise = signal_hu / 1000 * noise[0], noise_hu / 1000 * noise[1]
    noise -= signal * (signal * noise).sum() / signal.square().sum()
    target = 1 + signal + noise
    assert gain_preferred(stage_one_loss, signal, target) == pytest.approx(1, abs=0.0075)
    assert gain_preferred(partial(stage_one_loss, ssim_weight=0.1), signal, target) > 1.2


def test_contrast_counts_soft_tissue_five_times_as_much_as_bone(noise: torch.Tensor) -> None:
    tissue_then_bone = torch.full((48, 96), 1.04, dtype=torch.float64)
    tissue_then_bone[:, 48:] = 1.8
    texture = 0.02 * noise[0].repeat(1, 2)
    target = tissue_then_bone + texture
    flatter = tissue_then_bone + 0.5 * texture
    # Away from the edge between the two, which is neither.
    in_tissue, in_bone = target.clone(), target.clone()
    in_tissue[:, :30], in_bone[:, -30:] = flatter[:, :30], flatter[:, -30:]
    ratio = contrast_loss(in_tissue, target) / contrast_loss(in_bone, target)
    assert ratio.item() == pytest.approx(5, rel=0.1)
    unweighted = [1 - ssim_map(output, target, data_range_hu=400.0).mean() for output in (in_tissue, in_bone)]
    assert (unweighted[0] / unweighted[1]).item() == pytest.approx(1, rel=0.1)


def test_the_weight_is_that_of_the_target(noise: torch.Tensor) -> None:
    tissue = 1.04 + 0.02 * noise[0]
    half_bone = tissue.clone()
    half_bone[:, :24] += 0.8 + 0.02 * noise[1, :, :24]
    plain = 1 - ssim_map(half_bone, tissue, data_range_hu=400.0).mean().item()
    # One weight everywhere cancels.
    assert contrast_loss(half_bone, tissue).item() == pytest.approx(plain, rel=1e-3)
    assert contrast_loss(tissue, half_bone).item() < 0.8 * plain


def test_the_weight_is_5_in_soft_tissue_and_1_in_air_and_bone() -> None:
    weights = soft_tissue_weight(torch.tensor([[0.0, 1.04, 1.16, 1.8]], dtype=torch.float64))
    expected = torch.tensor([[1, 5, 1 + 4 / math.e, 1]], dtype=torch.float64)
    torch.testing.assert_close(weights, expected)


def test_the_printed_contrast_term_is_larger_the_more_alike_images_are(noise: torch.Tensor) -> None:
    target = 1.04 + 0.02 * noise[0]
    unlike = 1.04 + 0.02 * noise[1]
    paper = partial(contrast_loss, form="paper")
    assert paper(target, target).item() == pytest.approx(1)
    assert paper(unlike, target) < 0.5
    assert contrast_loss(unlike, target) > contrast_loss(target, target)


def test_a_weight_inside_the_similarity_is_a_smaller_data_range(noise: torch.Tensor) -> None:
    target, output = 1.04 + 0.001 * noise[0], 1.04 + 0.001 * noise[1]  # one weight, 5, nearly everywhere
    printed = contrast_loss(output, target, form="paper", data_range_hu=400.0)
    plain = ssim_map(output, target, data_range_hu=80.0).mean()
    assert printed.item() == pytest.approx(plain.item(), rel=1e-2)


# The two stages


def test_stages_are_the_weighted_sums_of_their_terms(noise: torch.Tensor) -> None:
    output, target = 1.04 + 0.02 * noise[0], 1.04 + 0.03 * noise[1]
    error = mean_squared_error(output, target)
    assert stage_one_loss(output, target, ssim_weight=0.0) == error
    expected = error + 0.1 * ssim_loss(output, target)
    torch.testing.assert_close(stage_one_loss(output, target, ssim_weight=0.1), expected)
    for form in ("corrected", "paper"):
        assert stage_two_loss(output, target, form=form, texture_weight=0.0, contrast_weight=0.0) == error
        expected = (
            error + 0.1 * texture_loss(output, target, form=form) + 0.2 * contrast_loss(output, target, form=form)
        )
        loss = stage_two_loss(output, target, form=form, texture_weight=0.1, contrast_weight=0.2)
        torch.testing.assert_close(loss, expected)


def test_by_default_stage_two_leaves_at_most_5_hu_of_noise(noise: torch.Tensor) -> None:
    truth = torch.full_like(noise[0], 1.04)
    target = truth + 0.01 * noise[1]
    loss = partial(stage_two_loss, contrast_weight=0.0)
    assert best(lambda deviation: loss(truth + deviation * noise[0], target), 1e-4, 0.1) < 5.1e-3
