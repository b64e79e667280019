import pytest
import torch

from pnpct.denoisers.network_cost import NetworkCost, network_cost
from pnpct.denoisers.rdn_cbam import RDNCBAM, SIZES, RDNSize
from pnpct.denoisers.red_cnn import REDCNN


@pytest.mark.parametrize("noise_input", [False, True])
def test_a_tiny_network_counted_by_hand(noise_input: bool) -> None:
    size = RDNSize(features=3, growth=2, blocks=1, convolutions=2, unshuffle=2)
    pixels = 5 * 4  # of 10 × 8, four to one
    inputs = 8 if noise_input else 4
    # Weights of the convolutions, in their order, each used once for every pixel; and as many biases as filters.
    weights = [
        inputs * 3 * 9,
        3 * 3 * 9,
        3 * 2 * 9,
        5 * 2 * 9,
        7 * 3,
        3 * 4,
        4 * 3,
        2 * 49,
        3 * 3,
        3 * 3 * 9,
        3 * 4 * 9,
    ]
    biases = [3, 3, 2, 2, 3, 4, 3, 1, 3, 3, 4]
    expected = NetworkCost(parameters=sum(weights) + sum(biases), multiply_adds=pixels * sum(weights))
    assert network_cost(RDNCBAM(size, noise_input=noise_input), 10, 8) == expected


def test_red_cnn_counted_by_hand() -> None:
    # Layers that shrink the image count where they write, those that widen it where they read.
    sides = [28, 24, 20, 16, 12, 12, 16, 20, 24, 28]
    weights = [25 * 96] + 8 * [25 * 96 * 96] + [25 * 96]
    expected = NetworkCost(
        parameters=1_848_865,
        multiply_adds=sum(side**2 * weight for side, weight in zip(sides, weights, strict=True)),
    )
    assert network_cost(REDCNN(), 32, 32) == expected


@pytest.mark.parametrize(
    ("name", "parameters", "billions"), [("small", 0.168e6, 11), ("medium", 2.24e6, 586), ("original", 21.98e6, 5760)]
)
def test_the_named_sizes_cost_what_is_said(name: str, parameters: float, billions: float) -> None:
    with torch.device("meta"):
        cost = network_cost(RDNCBAM(SIZES[name]), 512, 512)
    assert cost.parameters == pytest.approx(parameters, rel=0.01)
    assert cost.multiply_adds == pytest.approx(billions * 1e9, rel=0.02)


def test_counting_leaves_the_network_alone() -> None:
    network = RDNCBAM(RDNSize(features=2, growth=2, blocks=1, convolutions=1))
    network_cost(network, 8, 8)
    assert torch.equal(network(torch.ones(1, 8, 8)), torch.ones(1, 8, 8))
