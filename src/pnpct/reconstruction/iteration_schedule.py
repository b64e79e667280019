"""How σ_v falls from one iteration of plug-and-play to the next, and how many iterations are enough."""

from collections.abc import Iterator

from torch import Tensor

FIRST = 3.0
"""σ_v in the first iteration over that in the last one, at least: what edges need comes from the data at once."""

FALL = 0.45
"""σ_v in each of the first iterations over that of the one before."""

FEWEST, MOST = 4, 10
"""The fewest and the most iterations of plug-and-play, if nobody says how many."""


def enough_iterations(ratio: Tensor) -> Tensor:
    """Return how many iterations of plug-and-play are enough: more where there is more noise.

    With β counted in what the data of a pixel count, an iteration goes 1 / (1 + β) of the way to where data and prior
    leave an edge. In a chest at 100 mA β is below 1, in a large abdomen at 20 mA it is 18.

    Args:
        ratio: √β: the σ_v that is in balance with the data over the one that was asked for.
    """
    return (2.5 * ratio - 1.0).floor().clamp(FEWEST, MOST).long()


def falling(balanced: Tensor, last: float) -> Iterator[Tensor]:
    """Yield σ_v of each iteration, HU, for ever.

    It begins at `FIRST` times the last one, but no more than as many times the one that is in balance with the data,
    and no less than in balance; and falls by `FALL` in each.

    Args:
        balanced: σ_v in balance with the data of each image, HU.
        last: What it ends with, HU.
    """
    sigma_v = balanced.maximum((FIRST * balanced).clamp(max=FIRST * last))
    while True:
        sigma_v = sigma_v.clamp(min=last)
        yield sigma_v
        sigma_v = FALL * sigma_v
