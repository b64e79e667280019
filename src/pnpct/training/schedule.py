"""The learning rate of each step, and the running average of the weights.

The learning rate of AdamW rises, then falls as a cosine to zero; the network has the average of the latest weights. The
paper has Adam, whose learning rate falls by 1 % after each epoch.
"""

import math

import torch
from torch import nn

BATCH, LEARNING_RATE = 8, 1e-4
"""Pairs in a batch and highest learning rate, of the paper."""

WARM_UP = 0.05
"""Share of the steps of a stage in which the learning rate rises."""

MEMORY = 0.998
"""Share of the running average that a step keeps: the average is over the last 500 steps or so."""


def check_learning_rate(learning_rate: float) -> None:
    """Check that a learning rate is possible.

    Raises:
        ValueError: If it is not a positive number.
    """
    if not 0 < learning_rate < math.inf:
        raise ValueError(f"A learning rate is a positive number, got {learning_rate}.")


def share_of_rate(step: int, steps: int) -> float:
    """Return the learning rate of a step, of so many, over the highest."""
    rising = min(1.0, (step + 1) / (WARM_UP * steps))
    return rising * (1 + math.cos(math.pi * step / steps)) / 2


@torch.no_grad()
def average(running: nn.Module, latest: nn.Module, step: int) -> None:
    """Take the latest weights into the running average, with fewer steps sooner, and the rest as it is."""
    kept = min(MEMORY, (1 + step) / (10 + step))
    for mean, value in zip(running.state_dict().values(), latest.state_dict().values(), strict=True):
        if mean.is_floating_point():
            mean.lerp_(value, 1 - kept)
        else:
            mean.copy_(value)


def copied_weights(network: nn.Module) -> dict[str, torch.Tensor]:
    """Return copies of all weights, on the CPU."""
    return {name: value.detach().cpu().clone() for name, value in network.state_dict().items()}
