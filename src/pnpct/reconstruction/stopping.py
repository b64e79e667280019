"""When to stop ADMM: rules (before, after) -> bool, by name."""

from collections.abc import Callable, Iterator
from typing import Literal

from torch import Tensor

from pnpct.reconstruction.pnp_admm import ADMMState

StopRule = Callable[[ADMMState, ADMMState], bool]
RuleName = Literal["relative", "paper", "never"]


def change(before: ADMMState, after: ADMMState) -> Tensor:
    """Return (‖Δx‖² + ‖Δv‖² + ‖Δu‖²) / 3N of each image: the paper's measure, in squares of water = 1."""
    steps = [new - old for new, old in zip((after.x, after.v, after.u), (before.x, before.v, before.u), strict=True)]
    return sum((step.square().mean((-2, -1)) for step in steps[1:]), steps[0].square().mean((-2, -1))) / 3


def paper_rule(before: ADMMState, after: ADMMState, *, tolerance: float = 1e-4) -> bool:
    """Stop once `change` is at most `tolerance`: at 1e-4 the iterates still move by 10 HU.

    It is kept to repeat the paper. It holds after three to five iterations, long before convergence.

    References:
        The paper, appendix "Integration into PnP-MBIR Reconstruction".
    """
    return bool((change(before, after) <= tolerance).all())


def relative_rule(
    before: ADMMState, after: ADMMState, *, tolerance: float = 1e-3, disagreement_hu: float = 2.0
) -> bool:
    """Stop once the root of `change`, relative to x, is at most `tolerance`, and x and v agree to `disagreement_hu`.

    Where u is damped they need not agree even in the limit: then only a number of iterations ends ADMM.
    """
    size = after.x.square().mean((-2, -1)).clamp(min=1e-12)
    settled = change(before, after) <= tolerance**2 * size
    agreed = (after.x - after.v).square().mean((-2, -1)) <= (disagreement_hu / 1000) ** 2
    return bool((settled & agreed).all())


STOP_RULES: dict[RuleName, StopRule] = {
    "relative": relative_rule,
    "paper": paper_rule,
    "never": lambda _before, _after: False,
}


def until(
    states: Iterator[ADMMState], start: ADMMState, *, iterations: int, stop: StopRule = relative_rule
) -> Iterator[ADMMState]:
    """Yield states until the rule holds between one and the next, at most `iterations` of them.

    Args:
        states: Iterates of ADMM.
        start: The state they began from.
        iterations: Most states, at least 1.
        stop: Rule (before, after) -> bool.

    Raises:
        ValueError: If `iterations` is below 1 (at the first state).
    """
    if iterations < 1:
        raise ValueError(f"ADMM needs at least one iteration, got {iterations}.")
    before = start
    for number, after in enumerate(states, start=1):
        yield after
        if number == iterations or stop(before, after):
            return
        before = after
