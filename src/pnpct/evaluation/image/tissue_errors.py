"""In which tissues an image is wrong, and by how much."""

from collections.abc import Mapping
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from pnpct.arrays import Image
from pnpct.evaluation.image.errors import Window, bias_hu, checked_hu, rmse_hu
from pnpct.evaluation.image.regions import Mask

TISSUES: dict[str, Window] = {
    "air": (-1200.0, -950.0),
    "lung": (-950.0, -500.0),
    "fat": (-150.0, -30.0),
    "soft tissue": (-30.0, 150.0),
    "bone": (150.0, 3100.0),
}
"""Ranges of the truth, HU, without their upper ends. Values between lung and fat are partial volume and belong to no
tissue. A vessel with contrast medium counts as bone; metal counts nowhere."""


@dataclass(frozen=True)
class TissueError:
    """How far an image is from its reference in one tissue.

    Args:
        range_hu: Values of the reference in this tissue, HU, without the upper end.
        pixels: How many there are.
        rmse_hu: Root mean square difference, HU.
        bias_hu: Mean of image minus reference, HU.
    """

    range_hu: Window
    pixels: int
    rmse_hu: float
    bias_hu: float


def errors_by_tissue(
    image: Image,
    reference: Float[Tensor, "..."],
    *,
    mask: Mask | None = None,
    tissues: Mapping[str, Window] = TISSUES,
) -> dict[str, TissueError]:
    """Measure RMSE and bias in the tissues that the reference has.

    The reference should be the truth: noise sorts pixels into wrong tissues and makes a bias of its own. Pixels on
    edges count in the tissue whose range their mixture falls into.

    Args:
        image: Attenuation relative to water.
        reference: What it should be, of the same shape.
        mask: Where to count, of the same shape, say `body_mask(reference)`; everywhere if None.
        tissues: The range of each tissue, HU.

    Returns:
        The errors, in the order of `tissues`; a tissue of which there is no pixel is left out.

    Raises:
        ValueError: If the shapes differ or a number is not finite.

    Example:
        >>> truth = torch.tensor([[0.0, 1.0, 1.04]])
        >>> {name: error.bias_hu for name, error in errors_by_tissue(truth + 0.25, truth).items()}
        {'air': 250.0, 'soft tissue': 250.0...}
    """
    _, reference_hu = checked_hu(image, reference)
    counted = torch.ones_like(reference_hu, dtype=torch.bool) if mask is None else mask
    errors = {}
    for name, (low, high) in tissues.items():
        inside = (reference_hu >= low) & (reference_hu < high) & counted
        pixels = int(inside.sum())
        if pixels:
            rmse, bias = (metric(image, reference, mask=inside) for metric in (rmse_hu, bias_hu))
            errors[name] = TissueError((low, high), pixels, rmse, bias)
    return errors
