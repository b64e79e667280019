"""How training goes on from an epoch that may come from a damaged file."""

import copy
from collections.abc import Mapping, Sequence
from typing import Any

import torch
from torch import nn


def load_epoch(
    networks: Sequence[nn.Module],
    optimizer: torch.optim.Optimizer,
    weights: Sequence[Mapping[str, torch.Tensor]],
    state: Mapping[str, Any],
) -> None:
    """Put networks, and the optimizer, in the state in which an epoch has left them.

    Raises:
        ValueError: If weights are of another network, or the optimizer's state is not that of its parameters.
    """
    try:
        for network, of_network in zip(networks, weights, strict=True):
            network.load_state_dict(of_network)
        optimizer.load_state_dict(copy.deepcopy(dict(state)))  # the optimizer would go on in what it is given
        for group in optimizer.param_groups:
            for parameter in group["params"]:
                averages = [optimizer.state[parameter][name] for name in ("exp_avg", "exp_avg_sq")]
                if any(average.shape != parameter.shape or not average.isfinite().all() for average in averages):
                    raise ValueError("averages of other parameters")
        if not all(parameter.isfinite().all() for network in networks for parameter in network.parameters()):
            raise ValueError("weights are not finite")
    except (ArithmeticError, AttributeError, LookupError, RuntimeError, TypeError, ValueError) as error:
        raise ValueError(
            "The state that training should go on from is of another network, or damaged; remove the .training file to "
            "start again."
        ) from error
