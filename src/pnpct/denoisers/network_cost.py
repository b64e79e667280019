"""What a network costs: parameters, and multiplications per image."""

import copy
from dataclasses import dataclass

import torch
from torch import nn

from pnpct.denoisers.noise_level import is_noise_conditioned


@dataclass(frozen=True)
class NetworkCost:
    """What a network costs.

    Args:
        parameters: Numbers that are learned.
        multiply_adds: Multiplications with addition in all convolutions, for one image.
    """

    parameters: int
    multiply_adds: int


def network_cost(network: nn.Module, rows: int, cols: int) -> NetworkCost:
    """Count the parameters of a network and its multiply-adds for one image.

    Nothing is computed: the network is copied without its numbers. What is no convolution (means, sigmoids) takes time
    too and is not counted.

    Args:
        network: Takes images relative to water, alone or with a noise level if it has `noise_input`.
        rows: Rows of the image, at least 1.
        cols: Columns of the image, at least 1.

    Returns:
        Both numbers, exact.

    Example:
        >>> from pnpct.denoisers.rdn_cbam import RDNCBAM
        >>> network_cost(RDNCBAM(), 512, 512).parameters
        168224
    """
    from torch.utils.flop_counter import FlopCounterMode  # it loads Triton, and most commands count nothing

    with torch.device("meta"):
        image = torch.empty(1, rows, cols)
        inputs = (image, image) if is_noise_conditioned(network) else (image,)
    hollow = copy.deepcopy(network).to("meta", torch.float32)
    counter = FlopCounterMode(display=False)
    with counter, torch.no_grad():
        hollow(*inputs)
    operations = counter.get_flop_counts()["Global"][torch.ops.aten.convolution]
    # A multiplication and an addition are two operations.
    return NetworkCost(sum(parameter.numel() for parameter in network.parameters()), operations // 2)
