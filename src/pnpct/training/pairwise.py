"""The loss of a network on each of some pairs."""

from collections.abc import Callable, Sequence
from typing import TypeAlias

import torch
from torch import nn

from pnpct.denoisers.noise_level import is_noise_conditioned
from pnpct.training.losses import LossTerm
from pnpct.training.pairs import Pair

NumberedPairs: TypeAlias = Callable[[int], Pair]
"""Pairs by number, as `Pairs` is: the same number is always the same pair."""


def on_pairs(
    pairs: NumberedPairs, loss: LossTerm, *, bfloat16: bool = False
) -> Callable[[nn.Module, Sequence[int]], torch.Tensor]:
    """Return the losses of a network on the pairs of some numbers, for `train`.

    Args:
        pairs: Pairs by number.
        loss: From output and target to the loss.
        bfloat16: Whether the network computes in bfloat16 where that is accurate enough.
    """
    return lambda D, numbers: pairwise_losses(D, [*map(pairs, numbers)], loss, bfloat16=bfloat16)


def pairwise_losses(D: nn.Module, drawn: Sequence[Pair], loss: LossTerm, *, bfloat16: bool) -> torch.Tensor:
    """Return the loss of each pair, times its weight.

    Args:
        D: The network, on its device.
        drawn: Pairs of one size.
        loss: From output and target to the loss.
        bfloat16: Whether the network computes in bfloat16 where that is accurate enough.

    Raises:
        ValueError: If the network is noise-conditioned and a pair has no noise level.
    """
    device = next(D.parameters()).device
    with torch.autocast(device.type, torch.bfloat16, enabled=bfloat16):
        outputs = D(*_inputs(D, drawn, device)).float()
    pairwise = zip(drawn, outputs, strict=True)
    return torch.stack([pair.weight * loss(output, pair.target.to(device)) for pair, output in pairwise])


def _inputs(D: nn.Module, drawn: Sequence[Pair], device: torch.device) -> list[torch.Tensor]:
    """What the network is given: images, and their noise levels if it is conditioned on them."""
    images = torch.stack([pair.input for pair in drawn]).to(device)
    if not is_noise_conditioned(D):
        return [images]
    levels = [pair.noise_level for pair in drawn if pair.noise_level is not None]
    if len(levels) < len(drawn):
        raise ValueError(
            "This network is noise-conditioned, but these pairs have no noise level; train one without it."
        )
    return [images, torch.tensor(levels, device=device)[:, None, None]]
