"""The paper's training: Noise2Noise on low-dose pairs, then fine-tuning on pairs of low and high dose.

    stage 1   L = L_MSE + λ_SSIM L_SSIM                      between D(v_low) and another v_low
    stage 2   L = L_MSE + λ_tex L_tex + λ_ca L_ca            between D(v_low) and v_high

D is the network, v are images. In each stage the learning rate of AdamW rises and falls, and D is a running average.
"""

import copy
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, TypeAlias

import torch
from torch import distributed, nn

from pnpct.training.continuing import load_epoch
from pnpct.training.losses import LossTerm, stage_one_loss, stage_two_loss
from pnpct.training.pairwise import NumberedPairs, on_pairs
from pnpct.training.schedule import BATCH, LEARNING_RATE, average, check_learning_rate, copied_weights, share_of_rate

Stage: TypeAlias = Literal["noise-to-noise", "fine-tuning", "supervised", "single-scan", "through-loop"]
"""Which pairs an epoch has learnt from, and with which loss."""
Losses: TypeAlias = Callable[[nn.Module, Sequence[int]], torch.Tensor]
"""From a network and numbers to the loss of what each number stands for: a pair of images, or a scan."""


@dataclass(frozen=True, eq=False)
class Epoch:
    """Where training stands after an epoch; enough to continue from.

    Args:
        stage: Which part of the training it belongs to.
        number: Epochs of this stage that are done.
        loss: Mean loss over the pairs of this epoch, while the weights changed.
        weights: Copy of the network's weights, which are an average.
        latest: The weights after the last step.
        optimizer: Copy of the optimizer's state.
    """

    stage: Stage
    number: int
    loss: float
    weights: Mapping[str, torch.Tensor] = field(repr=False)
    latest: Mapping[str, torch.Tensor] = field(repr=False)
    optimizer: Mapping[str, Any] = field(repr=False)


def two_stage(
    D: nn.Module,
    noisy: NumberedPairs,
    dosed: NumberedPairs,
    *,
    epochs: tuple[int, int],
    losses: tuple[LossTerm, LossTerm] = (stage_one_loss, stage_two_loss),
    bfloat16: bool = False,
    after: Epoch | None = None,
    **options: Any,
) -> Iterator[Epoch]:
    """Train a network as the paper does, and yield every epoch.

    Args:
        D: The network; its weights change.
        noisy: Low-dose pairs with independent noise.
        dosed: Pairs of low and high dose.
        epochs: Epochs of the first and of the second stage.
        losses: Loss of the first and of the second stage.
        bfloat16: Whether the network computes in bfloat16 where that is accurate enough.
        after: Epoch to continue from; None begins.
        **options: As for `train`.

    Raises:
        ValueError: If a number is out of range, or the epoch is of other training.
    """
    if min(epochs) < 1:  # before the first stage, not after its hours
        raise ValueError(f"Both stages need at least one epoch, got {epochs[0]} and {epochs[1]}.")
    if after is None or after.stage == "noise-to-noise":
        first = on_pairs(noisy, losses[0], bfloat16=bfloat16)
        yield from train(D, first, stage="noise-to-noise", epochs=epochs[0], after=after, **options)
        after = None
    second = on_pairs(dosed, losses[1], bfloat16=bfloat16)
    yield from train(D, second, stage="fine-tuning", epochs=epochs[1], after=after, **options)


def train(
    D: nn.Module,
    losses: Losses,
    *,
    stage: Stage,
    epochs: int,
    pairs_per_epoch: int,
    batch: int = BATCH,
    micro_batch: int = 1,
    learning_rate: float = LEARNING_RATE,
    after: Epoch | None = None,
) -> Iterator[Epoch]:
    """Train a network on what is numbered, pairs mostly, and yield every epoch.

    Where `torch.distributed` is up, its processes share each batch, and all take the same steps.

    Args:
        D: The network, on its device; its weights change.
        losses: From numbers to losses, such as those `on_pairs`; each epoch has numbers of its own.
        stage: Name of the stage.
        epochs: Epochs in all, those before `after` included.
        pairs_per_epoch: Pairs in an epoch, a multiple of the batch size.
        batch: Pairs of one step of the optimizer, shared out evenly among processes.
        micro_batch: Pairs that pass through the network together, at least 1; more are faster, but take more memory.
        learning_rate: Highest learning rate of AdamW.
        after: Epoch to continue from.

    Raises:
        ValueError: If a number is out of range, the epoch is of another stage, or the loss diverges.
    """
    rank, world = (distributed.get_rank(), distributed.get_world_size()) if distributed.is_initialized() else (0, 1)
    if min(epochs, pairs_per_epoch, batch, micro_batch) < 1:
        sizes = f"{epochs} epochs of {pairs_per_epoch} pairs, {batch} in a batch and {micro_batch} in a micro-batch"
        raise ValueError(f"Training cannot have {sizes}; each is at least 1.")
    if pairs_per_epoch % batch or batch % world:
        raise ValueError(f"{pairs_per_epoch} pairs cannot be split into batches of {batch}, or a batch by {world}.")
    check_learning_rate(learning_rate)
    if after is not None and (after.stage != stage or after.number > epochs):
        raise ValueError(f"Epoch {after.number} of {after.stage} cannot be continued by {epochs} epochs of {stage}.")
    latest = copy.deepcopy(D).train()
    optimizer = torch.optim.AdamW(latest.parameters(), lr=learning_rate)
    if after is not None:
        load_epoch((D, latest), optimizer, (after.weights, after.latest), after.optimizer)
    for number in range(after.number if after else 0, epochs):
        total = torch.zeros((), dtype=torch.float64, device=next(D.parameters()).device)
        for first in range(number * pairs_per_epoch, (number + 1) * pairs_per_epoch, batch):
            rate = learning_rate * share_of_rate(first // batch, epochs * pairs_per_epoch // batch)
            optimizer.param_groups[0].update(lr=rate)
            optimizer.zero_grad()
            mine = range(first + rank, first + batch, world)
            for part in range(0, len(mine), micro_batch):
                of_part = losses(latest, mine[part : part + micro_batch])
                (of_part.sum() / batch).backward()
                total += of_part.detach().double().sum()
            for parameter in latest.parameters() if world > 1 else ():
                distributed.all_reduce(parameter.grad)
            optimizer.step()
            average(D, latest, first // batch)
        if world > 1:
            distributed.all_reduce(total)
        if not total.isfinite():
            raise ValueError(f"The loss is not finite in epoch {number + 1} of {stage}; lower the learning rate.")
        weights, state = (copied_weights(D), copied_weights(latest)), copy.deepcopy(optimizer.state_dict())
        yield Epoch(stage, number + 1, float(total) / pairs_per_epoch, *weights, state)
