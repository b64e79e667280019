"""From images to arrays of HU that numpy and scipy can measure."""

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray
from torch import Tensor

from pnpct.units import to_hu


def hu_array(image: Float[Tensor, "..."]) -> NDArray[np.float64]:
    """Return an image in HU, in double precision and on the CPU.

    Args:
        image: Attenuation relative to water.

    Returns:
        HU, of the image's shape.

    Raises:
        ValueError: If a number is not finite.

    Example:
        >>> import torch
        >>> hu_array(torch.tensor([[0.0, 1.0]])).tolist()
        [[-1000.0, 0.0]]
    """
    hu: NDArray[np.float64] = to_hu(image.detach().double()).cpu().numpy()
    if not np.isfinite(hu).all():
        raise ValueError("The image has values that are not finite; nothing can be measured on it.")
    return hu


def check_window(window: tuple[float, float]) -> None:
    """Refuse a window in HU that has no width.

    Raises:
        ValueError: If the lower end is not below the upper one, or an end is not finite.
    """
    low, high = window
    if not (np.isfinite(low) and np.isfinite(high) and low < high):
        raise ValueError(f"A window goes from a lower to a higher value in HU, got {window}.")
