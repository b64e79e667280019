"""What only a strong prior shows: the same data reconstructed with more and less of it."""

from collections.abc import Mapping
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from pnpct.evaluation.data.disc_information import disc_template, sum_around
from pnpct.evaluation.data.score_test import ScoreTest
from pnpct.geometry.short_repr import short_repr


@dataclass(frozen=True, eq=False)
class PriorDriven:
    """What a prior of some strength has changed, against the weakest.

    Args:
        strength: Of the prior, in the unit of whoever made the images.
        difference_hu: Image minus that of the weakest prior, both averaged over discs, HU. To be displayed.
        largest: Its largest size in units of the verifiable contrast. Above 1 the data could have confirmed such a
            disc, and `score_test` says whether they do; below 1 they cannot, and only the prior vouches for it.
        change_hu: The difference at that place, HU.
        position: x and y of that place, mm.
    """

    strength: float
    difference_hu: Float[Tensor, "rows cols"]
    largest: float
    change_hu: float
    position: tuple[float, float]

    __repr__ = short_repr


def prior_sweep(
    images: Mapping[float, Float[Tensor, "rows cols"]], test: ScoreTest, *, mask: Bool[Tensor, "..."] | None = None
) -> tuple[PriorDriven, ...]:
    """Show what appears or vanishes as the prior gets stronger.

    All images are averaged over discs of the test's diameter, which takes away most of the noise that a weak prior
    leaves, and compared with the image of the weakest prior.

    Args:
        images: One slice for each strength of the prior, from the same data; at least two strengths.
        test: A score test of one of these images, with the diameter of the averages, 4 mm say: it has the
            verifiable contrast, which is that of the data and does not depend on the image.
        mask: Where the largest difference is looked for, say the body; everywhere if None.

    Returns:
        The differences, from the weakest of the other strengths to the strongest.

    Raises:
        ValueError: If there are fewer than two strengths, or an image or the mask is not on the test's grid.
    """
    if len(images) < 2:
        raise ValueError(f"A sweep needs images of two strengths of the prior or more, got {len(images)}.")
    for strength, image in images.items():
        if image.shape != test.t.shape:
            raise ValueError(
                f"The image of strength {strength:g} must have the {tuple(test.t.shape)} pixels of the test, got "
                f"{tuple(image.shape)}."
            )
    mask = torch.ones_like(test.t, dtype=torch.bool) if mask is None else mask
    if mask.shape != test.t.shape:
        raise ValueError(f"The mask must have the {tuple(test.t.shape)} pixels of the test, got {tuple(mask.shape)}.")
    template = disc_template(test.diameter, test.grid.spacing)
    weakest, *stronger = sorted(images)
    return tuple(_compared(strength, images[strength] - images[weakest], template, test, mask) for strength in stronger)


def _compared(strength: float, difference: Tensor, template: Tensor, test: ScoreTest, mask: Tensor) -> PriorDriven:
    averaged = 1000 * sum_around(difference.detach(), template / template.sum())
    in_units = torch.where(mask, averaged.abs() / test.verifiable_hu.to(averaged), 0.0)
    place = int(in_units.argmax())
    row, col = divmod(place, test.grid.cols)
    return PriorDriven(
        float(strength),
        averaged,
        largest=float(in_units[row, col]),
        change_hu=float(averaged[row, col]),
        position=(float(test.grid.x[col]), float(test.grid.y[row])),
    )
