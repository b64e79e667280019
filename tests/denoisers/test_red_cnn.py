import pytest
import torch

from pnpct.denoisers.red_cnn import REDCNN


def awake() -> REDCNN:
    """Return a network that does something: the last layer of a new one is zero."""
    torch.manual_seed(3)
    network = REDCNN(filters=4).double()
    for parameter in network.decoders[-1].parameters():
        torch.nn.init.normal_(parameter, std=0.2)
    return network


@pytest.fixture
def images(generator: torch.Generator) -> torch.Tensor:
    return 1 + 0.1 * torch.randn(2, 2, 23, 25, generator=generator, dtype=torch.float64)


def test_a_new_network_returns_its_input_below_air_too(images: torch.Tensor) -> None:
    noisy_air = images - 1
    assert torch.equal(REDCNN(filters=4).double()(noisy_air), noisy_air)


def test_it_is_the_network_of_its_paper(images: torch.Tensor) -> None:
    network = awake()
    c, d, relu = network.encoders, network.decoders, torch.relu
    x = images[0, :1] - 1  # one image, one channel
    first = relu(c[0](x))
    second = relu(c[1](first))
    third = relu(c[2](second))
    fourth = relu(c[3](third))
    fifth = relu(c[4](fourth))
    back = relu(d[0](fifth) + fourth)
    back = relu(d[1](back))
    back = relu(d[2](back) + second)
    back = relu(d[3](back))
    torch.testing.assert_close(network(images)[0, 0], (d[4](back) + x + 1)[0])


def test_a_batch_is_its_slices(images: torch.Tensor) -> None:
    network = awake()
    slices = torch.stack([network(one) for one in images.flatten(0, 1)]).reshape(images.shape)
    torch.testing.assert_close(network(images), slices)


def test_every_parameter_learns(images: torch.Tensor) -> None:
    network = awake()
    network(images).square().sum().backward()
    for name, parameter in network.named_parameters():
        assert parameter.grad is not None, name
        assert parameter.grad.abs().max() > 0, name


def test_images_smaller_than_what_the_convolutions_take_away_are_refused() -> None:
    assert REDCNN(filters=2)(torch.ones(21, 21)).shape == (21, 21)
    with pytest.raises(ValueError, match="at least 21 pixels a side, got 20 x 40"):
        REDCNN(filters=2)(torch.ones(20, 40))


def test_no_filters_are_refused() -> None:
    with pytest.raises(ValueError, match="at least one filter"):
        REDCNN(filters=0)
