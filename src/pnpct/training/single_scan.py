"""Pairs of images from a single scan: a subset of its views against the others (Noise2Inverse)."""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from pnpct.geometry.short_repr import short_repr
from pnpct.training.augmentation import change_alike
from pnpct.training.pairs import Pair


@dataclass(frozen=True, eq=False)
class SplitViewPairs:
    """Pairs by number: the same number is the same pair, whoever asks, in whatever order.

    With the views of a scan divided into K interleaved subsets, and an image of each,

        target = part j,     input = mean of the other parts.

    Both show one object, and no view is in both, so that their noise is independent as long as that of the views is;
    what is wrong in all views alike, such as beam hardening, is learnt as anatomy. The input has K/(K − 1) times the
    noise power of an image from all views, which the network will be given: more parts are closer to it, but each has
    stronger streaks.

    Args:
        parts: Images of the subsets, relative to water, linear in the data, along the first axis.
        seed: Seed of everything that is drawn.
        augment: Whether pairs are mirrored, turned, moved and scaled at random.
        side: Rows and columns of a patch, taken at random; None takes whole images.

    Raises:
        ValueError: If there are fewer than two parts, or their values are not finite.

    References:
        Hendriksen et al., IEEE Trans. Comput. Imaging 6 (2020) 1320, with the strategy X:1.

    Example:
        >>> pairs = SplitViewPairs(torch.tensor([1.0, 2.0, 6.0]).reshape(3, 1, 1), seed=0, augment=False)
        >>> sorted({(pair.input.item(), pair.target.item()) for pair in map(pairs, range(20))})
        [(1.5, 6.0), (3.5, 2.0), (4.0, 1.0)]
    """

    parts: Float[Tensor, "parts *slices rows cols"]
    seed: int
    augment: bool = True
    side: int | None = None

    __repr__ = short_repr

    def __post_init__(self) -> None:
        if self.parts.ndim < 3 or len(self.parts) < 2:
            raise ValueError(f"One part is predicted from the others: two or more are needed, got {len(self.parts)}.")
        if not bool(self.parts.isfinite().all()):
            raise ValueError("Images to learn from must be finite; some values are NaN or infinite.")

    def __call__(self, number: int) -> Pair:
        """Draw the pair of a number, from 0 on.

        Raises:
            ValueError: If the images are smaller than the square.
        """
        draw = np.random.default_rng([self.seed, number])
        slices = self.parts.flatten(1, -3) if self.parts.ndim > 3 else self.parts[:, None]
        images = slices[:, int(draw.integers(slices.shape[1]))]
        drawn = int(draw.integers(len(images)))
        others = torch.cat((images[:drawn], images[drawn + 1 :])).mean(0)
        noisy, target = change_alike([others, images[drawn]], draw, augment=self.augment, side=self.side)
        return Pair(noisy, target)
