"""Images on other grids, area for area."""

import numpy as np
import torch
from jaxtyping import Float
from numpy.typing import NDArray
from torch import Tensor

from pnpct.geometry import ImageGrid


def area_average(
    image: Float[Tensor, "*batch rows cols"], grid: ImageGrid, onto: ImageGrid
) -> Float[Tensor, "*batch new_rows new_cols"]:
    """Average an image over the pixels of another grid; beyond its own grid it is 0.

    A pixel stands for a square of one value, so the answer is exact for coarser and for finer pixels. It does
    not interpolate: finer pixels repeat the value that they lie in.

    Args:
        image: Floating-point values, the last two dimensions on `grid`.
        grid: Where the pixels of the image are.
        onto: Where those of the result are.

    Returns:
        The averages, in the precision and on the device of the image.

    Raises:
        ValueError: If the image does not fit its grid.

    Example:
        >>> area_average(torch.ones(1, 2), ImageGrid(1, 2, spacing=1.0), ImageGrid(1, 2, spacing=1.5))
        tensor([[0.4444, 0.4444]])
    """
    if tuple(image.shape[-2:]) != grid.shape:
        raise ValueError(f"The image must end in (rows, cols) = {grid.shape}, got {tuple(image.shape)}.")
    rows = _overlaps(-grid.y, grid.spacing, -onto.y, onto.spacing).to(image)
    cols = _overlaps(grid.x, grid.spacing, onto.x, onto.spacing).to(image)
    return rows @ image @ cols.T


def _overlaps(
    old: NDArray[np.float64], old_spacing: float, new: NDArray[np.float64], new_spacing: float
) -> Float[Tensor, "new old"]:
    """The fraction of each new pixel that each old one covers, along one axis; positions grow."""
    low = np.maximum(new[:, None] - new_spacing / 2, old - old_spacing / 2)
    high = np.minimum(new[:, None] + new_spacing / 2, old + old_spacing / 2)
    return torch.from_numpy(np.maximum(high - low, 0.0) / new_spacing)
