import math

import pytest
import torch

from pnpct.denoisers.learned import LearnedDenoiser
from pnpct.denoisers.rdn_cbam import RDNCBAM, RDNSize
from pnpct.denoisers.red_cnn import REDCNN

TINY = RDNSize(features=4, growth=2, blocks=1, convolutions=2, unshuffle=2)


def awake(**options) -> RDNCBAM:
    torch.manual_seed(3)
    network = RDNCBAM(TINY, **options)
    for parameter in network.noise.parameters():
        torch.nn.init.normal_(parameter, std=0.2)
    return network


@pytest.fixture
def images(generator: torch.Generator) -> torch.Tensor:
    return 1 + 0.1 * torch.randn(2, 3, 17, 19, generator=generator)


@pytest.mark.parametrize("network", [awake(), REDCNN(filters=2)], ids=["rdn_cbam", "red_cnn"])
@pytest.mark.parametrize("shape", [(24, 22), (1, 24, 22), (2, 3, 23, 25)])
def test_it_does_what_the_network_does_in_any_shape(
    network: torch.nn.Module, shape: tuple[int, ...], generator: torch.Generator
) -> None:
    images = 1 + 0.1 * torch.randn(shape, generator=generator)
    with torch.no_grad():
        torch.testing.assert_close(LearnedDenoiser(network)(images), network(images), rtol=0, atol=1e-6)


def test_what_is_denser_than_bone_is_handed_on(images: torch.Tensor) -> None:
    denoise = LearnedDenoiser(awake())
    images[..., 5:9, 5:9] = 4.0
    with_metal = images.clone()
    with_metal[..., 5:9, 5:9] += torch.arange(16.0).reshape(4, 4)
    torch.testing.assert_close(denoise(with_metal) - denoise(images), with_metal - images)
    assert (denoise(images) != images).any()


def test_an_empty_batch_stays_empty() -> None:
    assert LearnedDenoiser(awake())(torch.ones(0, 3, 24, 22)).shape == (0, 3, 24, 22)


@pytest.mark.parametrize("batch", [1, 4, 6, 100])
def test_how_many_slices_are_worked_on_together_does_not_matter(batch: int, images: torch.Tensor) -> None:
    network = awake()
    slices = torch.stack([LearnedDenoiser(network)(one) for one in images.flatten(0, 1)]).reshape(images.shape)
    torch.testing.assert_close(LearnedDenoiser(network, batch=batch)(images), slices, rtol=0, atol=1e-6)


def test_the_type_of_the_image_is_kept(images: torch.Tensor) -> None:
    denoise = LearnedDenoiser(awake())
    result = denoise(images.double())
    assert result.dtype == torch.float64
    torch.testing.assert_close(result.float(), denoise(images), rtol=0, atol=1e-6)


def test_the_network_is_left_alone_and_what_happens_to_it_later_has_no_effect(images: torch.Tensor) -> None:
    network = awake()
    denoise = LearnedDenoiser(network)
    before = denoise(images)
    assert network.training
    assert all(parameter.requires_grad for parameter in network.parameters())
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.zero_()
    assert torch.equal(denoise(images), before)


def test_the_result_has_no_gradient_and_may_be_worked_on_in_place(images: torch.Tensor) -> None:
    result = LearnedDenoiser(awake())(images.requires_grad_(True))
    assert not result.requires_grad
    assert result.clamp_(min=0.0).requires_grad_(True).sum().grad_fn is not None


def test_a_noise_level_is_bound_as_a_number_or_a_map(images: torch.Tensor) -> None:
    network = awake(noise_input=True)
    result = LearnedDenoiser(network, noise_level=0.05)(images)
    with torch.no_grad():
        torch.testing.assert_close(result, network(images, 0.05), rtol=0, atol=1e-6)
    level = torch.full(images.shape[-2:], 0.05)
    torch.testing.assert_close(LearnedDenoiser(network, noise_level=level, batch=2)(images), result)
    assert (LearnedDenoiser(network, noise_level=0.5)(images) - result).abs().max() > 1e-4


def test_eight_bits_change_what_is_taken_off_a_little_and_nothing_else(images: torch.Tensor) -> None:
    network = awake()
    exact, quick = LearnedDenoiser(network)(images), LearnedDenoiser(network, bfloat16=True)(images)
    assert quick.dtype == torch.float32
    error = (quick - exact).square().mean().sqrt()
    assert 0 < error < 0.01 * (exact - images).square().mean().sqrt()
    untouched = LearnedDenoiser(RDNCBAM(TINY), bfloat16=True)(images)
    assert torch.equal(untouched, images)


def test_noise_levels_that_cannot_be_are_refused() -> None:
    with pytest.raises(ValueError, match="noise-conditioned: give it the noise level"):
        LearnedDenoiser(awake(noise_input=True))
    with pytest.raises(ValueError, match="not noise-conditioned"):
        LearnedDenoiser(awake(), noise_level=0.05)
    with pytest.raises(ValueError, match="not noise-conditioned"):
        LearnedDenoiser(REDCNN(filters=2), noise_level=0.05)
    for level in (-0.1, math.nan, torch.tensor([[0.1, math.inf]])):
        with pytest.raises(ValueError, match="standard deviation from 0 up"):
            LearnedDenoiser(awake(noise_input=True), noise_level=level)


def test_a_batch_of_no_slices_is_refused() -> None:
    with pytest.raises(ValueError, match="At least one slice"):
        LearnedDenoiser(awake(), batch=0)


def test_two_passes_apply_the_network_twice_and_between_is_the_mean(images: torch.Tensor) -> None:
    network = awake()
    once, between, twice, thrice = (LearnedDenoiser(network, passes=passes) for passes in (1.0, 1.5, 2.0, 3.0))
    torch.testing.assert_close(twice(images), once(once(images)), rtol=0, atol=1e-6)
    torch.testing.assert_close(thrice(images), once(twice(images)), rtol=0, atol=1e-6)
    torch.testing.assert_close(between(images), (once(images) + twice(images)) / 2, rtol=0, atol=1e-6)


@pytest.mark.parametrize("passes", [0.5, 4.5, math.nan])
def test_impossible_passes_are_refused(passes: float) -> None:
    with pytest.raises(ValueError, match="1 to 4 times"):
        LearnedDenoiser(awake(), passes=passes)
