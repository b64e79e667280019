"""When to stop ADMM: rules by name."""

from collections.abc import Callable, Iterator
from typing import Literal

import torch
from torch import Tensor

from pnpct.operators.linear_operator import LinearOperator
from pnpct.reconstruction.pnp_admm import ADMMState

Dims = tuple[int, ...]
"""The dimensions of an image, `A.domain_dims`; those before them are a batch."""

StopRule = Callable[[ADMMState, ADMMState, Dims], bool]
RuleName = Literal["relative", "paper", "never"]
"""When iterations end before the most that are allowed; see `STOP_RULES`."""


def change(before: ADMMState, after: ADMMState, dims: Dims) -> Tensor:
    """Return (‖Δx‖² + ‖Δv‖² + ‖Δu‖²) / 3N of each image: the paper's measure, in squares of water = 1."""
    steps = [new - old for new, old in zip((after.x, after.v, after.u), (before.x, before.v, before.u), strict=True)]
    return torch.stack([step.square().mean(dims) for step in steps]).mean(0)


def paper_rule(before: ADMMState, after: ADMMState, dims: Dims, *, tolerance: float = 1e-4) -> bool:
    """Stop once `change` is at most `tolerance`: at 1e-4 the iterates still move by 10 HU.

    It is there to reproduce the paper. It holds after three to five iterations, long before convergence.

    References:
        The paper, appendix "Integration into PnP-MBIR Reconstruction".
    """
    return bool((change(before, after, dims) <= tolerance).all())


def relative_rule(
    before: ADMMState, after: ADMMState, dims: Dims, *, tolerance: float = 1e-3, disagreement_hu: float = 2.0
) -> bool:
    """Stop once the root of `change`, relative to x, is at most `tolerance`, and x and v agree to `disagreement_hu`.

    Where u is damped they need not agree even in the limit: then only a number of iterations ends ADMM.
    """
    size = after.x.square().mean(dims).clamp(min=1e-12)
    settled = change(before, after, dims) <= tolerance**2 * size
    agreed = (after.x - after.v).square().mean(dims) <= (disagreement_hu / 1000) ** 2
    return bool((settled & agreed).all())


STOP_RULES: dict[RuleName, StopRule] = {
    "relative": relative_rule,
    "paper": paper_rule,
    "never": lambda _before, _after, _dims: False,
}
"""Rules by name: whether to stop, from a state and the one before."""


LARGEST = 100.0
"""Root mean square of an iterate, water = 1 or the size of the start, beyond which ADMM diverges."""


def check_bounded(start: ADMMState, after: ADMMState, number: int) -> None:
    """Check that the iterates are finite and no larger than any body.

    Raises:
        ValueError: If ADMM diverges.
    """
    size = start.v.square().mean().sqrt().clamp(min=1.0)
    largest = torch.stack([iterate.square().mean().sqrt() for iterate in (after.x, after.v, after.u)]).max()
    if not bool(largest <= LARGEST * size):  # so that NaN counts
        raise ValueError(
            f"ADMM needs iterates that stay bounded, but in iteration {number} they reach {float(largest):.3g} times "
            "water: the denoiser makes the image larger, or the data and their weights do not fit the geometry; check "
            "these, or damp ADMM."
        )


def until(
    states: Iterator[ADMMState], start: ADMMState, A: LinearOperator, *, iterations: int, stop: RuleName
) -> Iterator[ADMMState]:
    """Yield states until the rule holds between one and the next, at most `iterations` of them.

    Args:
        states: Iterates of ADMM.
        start: The state they began from.
        A: The projector, which knows the dimensions of an image.
        iterations: Maximum number of states, at least 1.
        stop: Name of the rule, one of `STOP_RULES`.

    Raises:
        ValueError: If `iterations` is below 1 or there is no such rule (at the first state), or ADMM diverges.
    """
    if iterations < 1:
        raise ValueError(f"ADMM needs at least one iteration, got {iterations}.")
    if stop not in STOP_RULES:
        raise ValueError(f'There is no stopping rule "{stop}"; the rules are {", ".join(STOP_RULES)}.')
    rule, before = STOP_RULES[stop], start
    for number, after in enumerate(states, start=1):
        check_bounded(start, after, number)
        yield after
        if number == iterations or rule(before, after, A.domain_dims):
            return
        before = after
