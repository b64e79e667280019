from itertools import product

import pytest
import torch

from pnpct.denoisers.attention import ConvolutionalAttention
from pnpct.denoisers.rdn_cbam import RDNCBAM, SIZES, RDNSize

TINY = RDNSize(features=4, growth=4, blocks=2, convolutions=2)
TINY_UNSHUFFLED = RDNSize(features=4, growth=4, blocks=2, convolutions=2, unshuffle=2)


def awake(size: RDNSize, **options) -> RDNCBAM:
    """Return a network that does something: the last layer of a new one is zero."""
    torch.manual_seed(3)
    network = RDNCBAM(size, **options).double()
    for parameter in network.noise.parameters():
        torch.nn.init.normal_(parameter, std=0.2)
    return network


@pytest.fixture
def images(generator: torch.Generator) -> torch.Tensor:
    return 1 + 0.1 * torch.randn(2, 3, 16, 20, generator=generator, dtype=torch.float64)


@pytest.mark.parametrize("attention", ["local", "global"])
@pytest.mark.parametrize("size", [TINY, TINY_UNSHUFFLED, SIZES["small"]])
def test_a_new_network_returns_its_input(size: RDNSize, attention: str, images: torch.Tensor) -> None:
    assert torch.equal(RDNCBAM(size, attention=attention)(images.float()), images.float())
    assert torch.equal(RDNCBAM(size, attention=attention, noise_input=True)(images.float(), 0.03), images.float())


def extent_difference(network: RDNCBAM, generator: torch.Generator, *, offset: int) -> float:
    """Compare the interior of an image with the same pixels of a larger one that holds it."""
    large = 1 + 0.1 * torch.randn(140, 144, generator=generator, dtype=torch.float64)
    large[:10, :10] = 9.0  # metal, outside the smaller image
    with torch.no_grad():
        small = network(large[offset : offset + 116, offset : offset + 116])
        part = network(large)[offset : offset + 116, offset : offset + 116]
    return (small - part)[56:-56, 56:-56].abs().max().item()


@pytest.mark.parametrize(("size", "offset"), [(TINY, 17), (TINY_UNSHUFFLED, 18)])
def test_the_extent_of_the_image_does_not_matter_away_from_the_border(
    size: RDNSize, offset: int, generator: torch.Generator
) -> None:
    assert extent_difference(awake(size), generator, offset=offset) < 1e-12


def test_with_the_published_attention_it_does(generator: torch.Generator) -> None:
    assert extent_difference(awake(TINY, attention="global"), generator, offset=17) > 1e-6


def test_a_batch_is_its_slices(images: torch.Tensor) -> None:
    network = awake(TINY_UNSHUFFLED)
    slices = torch.stack([network(one) for one in images.flatten(0, 1)]).reshape(images.shape)
    torch.testing.assert_close(network(images), slices)


@pytest.mark.parametrize(("rows", "cols"), [(15, 20), (16, 19), (15, 19), (1, 1)])
def test_odd_sizes_are_continued_by_their_mirror_image(rows: int, cols: int, images: torch.Tensor) -> None:
    network = awake(TINY_UNSHUFFLED)
    odd = images[..., :rows, :cols]
    even = torch.nn.functional.pad(odd, (0, cols % 2, 0, rows % 2), mode="replicate")
    torch.testing.assert_close(network(odd), network(even)[..., :rows, :cols])


def test_a_noise_level_is_heeded_as_a_number_a_map_or_one_per_image(images: torch.Tensor) -> None:
    network = awake(TINY_UNSHUFFLED, noise_input=True)
    result = network(images, 0.05)
    assert (result - network(images, 0.1)).abs().max() > 1e-5
    torch.testing.assert_close(network(images, torch.full(images.shape[-2:], 0.05, dtype=torch.float64)), result)
    levels = torch.tensor([0.1, 0.2, 0.05], dtype=torch.float64)[:, None, None]
    torch.testing.assert_close(network(images, levels)[:, 2], result[:, 2])
    torch.testing.assert_close(network(images, levels)[:, 1], network(images[:, 1], 0.2))


def test_a_map_acts_where_it_changes(images: torch.Tensor) -> None:
    network = awake(TINY, noise_input=True)
    wide = torch.nn.functional.pad(images, (0, 100), value=1.0)
    level = torch.full_like(wide, 0.05)
    level[..., -4:] = 0.5
    change = (network(wide, level) - network(wide, 0.05)).abs()
    assert change[..., -4:].max() > 1e-5
    assert change[..., :20].max() < 1e-12


def test_a_noise_level_is_refused_where_there_is_no_input_for_it_and_missed_where_there_is(
    images: torch.Tensor,
) -> None:
    with pytest.raises(ValueError, match="not noise-conditioned"):
        RDNCBAM(TINY)(images.float(), 0.05)
    with pytest.raises(ValueError, match="noise-conditioned: give it the noise level"):
        RDNCBAM(TINY, noise_input=True)(images.float())


@pytest.mark.parametrize("attention", ["local", "global"])
@pytest.mark.parametrize("noise_input", [False, True])
def test_every_parameter_learns(attention: str, noise_input: bool, images: torch.Tensor) -> None:
    network = awake(TINY_UNSHUFFLED, attention=attention, noise_input=noise_input)
    network(images, *([0.05] if noise_input else [])).square().sum().backward()
    for name, parameter in network.named_parameters():
        assert parameter.grad is not None, name
        assert parameter.grad.abs().max() > 0, name


def test_local_attention_is_its_formula(generator: torch.Generator) -> None:
    attend = ConvolutionalAttention(3, window=3).double()
    features = torch.randn(1, 3, 5, 6, generator=generator, dtype=torch.float64)
    means = torch.empty_like(features)
    for row, col in product(range(5), range(6)):
        around = features[..., max(row - 1, 0) : row + 2, max(col - 1, 0) : col + 2]
        means[..., row, col] = around.mean(dim=(2, 3))
    weighed = features * torch.sigmoid(attend.excite(torch.relu(attend.squeeze(means))))
    pooled = torch.stack([weighed.mean(dim=1), weighed.amax(dim=1)], dim=1)
    torch.testing.assert_close(attend(features), weighed * torch.sigmoid(attend.spatial(pooled)))


def test_global_attention_is_local_attention_with_a_window_over_all_plus_the_maximum(
    generator: torch.Generator,
) -> None:
    everywhere = ConvolutionalAttention(3, window=31, attention="global").double()
    features = torch.randn(1, 3, 5, 6, generator=generator, dtype=torch.float64)
    scores = [
        everywhere.excite(torch.relu(everywhere.squeeze(pooled)))
        for pooled in (features.mean(dim=(2, 3), keepdim=True), features.amax(dim=(2, 3), keepdim=True))
    ]
    weighed = features * torch.sigmoid(scores[0] + scores[1])
    pooled = torch.stack([weighed.mean(dim=1), weighed.amax(dim=1)], dim=1)
    torch.testing.assert_close(everywhere(features), weighed * torch.sigmoid(everywhere.spatial(pooled)))


def test_sizes_outside_their_range_are_refused() -> None:
    with pytest.raises(ValueError, match="at least one of everything"):
        RDNSize(features=4, growth=2, blocks=0, convolutions=2)
    with pytest.raises(ValueError, match="unshuffled by 1"):
        RDNSize(features=4, growth=2, blocks=1, convolutions=2, unshuffle=4)
