"""Pairs of images: the input of a denoiser, and its target."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pnpct.arrays import Image
from pnpct.geometry.short_repr import short_repr
from pnpct.training.augmentation import change_alike
from pnpct.training.examples import Example

_NOISE = 0.03 / 2**0.5
"""Noise of FBP images, relative to water, of pairs of weight 1: two scans then differ by 30 HU."""


_DIVERGED = 3.0
"""A loop image with a largest value that exceeds that of the FBP images so many times has diverged."""


@dataclass(frozen=True, eq=False)
class Pair:
    """The input of a denoiser, and what it should return.

    Args:
        input: Noisy image, relative to water.
        target: Image of the same slice, with independent noise.
        weight: Weight of the pair.
        noise_level: Standard deviation of the noise of an FBP image of that dose, relative to water, for
            noise-conditioned networks; None where it is not known.
    """

    input: Image
    target: Image
    weight: float = 1.0
    noise_level: float | None = None

    __repr__ = short_repr


@dataclass(frozen=True, eq=False)
class Pairs:
    """Pairs by number: the same number is the same pair, whoever asks, in whatever order.

    Half of the inputs are FBP images and half any of the other images of the example, except those that diverged, as
    the loop may at metal: one such image outweighs thousands. The target of noisy pairs is never of the loop: the
    noise of FBP has a mean of zero, and it keeps what ADMM may have lost on its way. The noisier its FBP images,
    the less a pair weighs, or the lowest doses would dominate.

    Args:
        examples: Examples by number, as `Examples` is.
        kind: "noisy" pairs are two low-dose scans, either of which may be the input (criss-cross); in "dose" pairs
            the target is the reference of that way.
        seed: Seed of everything that is drawn.
        distinct: Number of examples before they are repeated, each time with another augmentation; None never
            repeats one.
        augment: Whether pairs are mirrored, turned, moved and scaled at random.
        side: Rows and columns of a patch, taken at random; None takes whole images.
        discount: Power of the noise that the weight of a pair is divided by, 0 to 4: 0 weighs all alike, 2 makes
            their squared errors alike.

    Raises:
        ValueError: If there is no example, or the discount is out of range.
    """

    examples: Callable[[int], Example]
    kind: Literal["noisy", "dose"]
    seed: int
    distinct: int | None = None
    augment: bool = True
    side: int | None = None
    discount: float = 1.0

    def __post_init__(self) -> None:
        if self.distinct is not None and self.distinct < 1:
            raise ValueError(f"Pairs are drawn from at least one example, got {self.distinct}.")
        if not 0 <= self.discount <= 4:
            raise ValueError(f"The discount of noisy pairs is a power from 0 to 4, got {self.discount:g}.")

    def __call__(self, number: int) -> Pair:
        """Draw the pair of a number, from 0 on."""
        draw = np.random.default_rng([self.seed, number])
        example = self.examples(number if self.distinct is None else number % self.distinct)
        fbp, limit = example.low, _DIVERGED * example.low.abs().max()
        others = [way for way, image in enumerate(example.others, 1) if image.abs().max() <= limit]
        first, way = int(draw.integers(2)), 0
        if others and draw.integers(2) == 1:
            way = others[int(draw.integers(len(others)))]
        if way > 0:
            first = 0
        noisy = fbp[first] if way == 0 else example.others[way - 1]
        target = fbp[1 - first] if self.kind == "noisy" else example.references[way]
        weight = (_NOISE / max(example.noise_level, 1e-5)) ** self.discount
        noisy, target = change_alike([noisy, target], draw, augment=self.augment, side=self.side)
        return Pair(noisy, target, weight, noise_level=example.noise_level)
