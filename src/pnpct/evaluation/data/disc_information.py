"""Discs of one size, at every pixel: their template, and what the data say about each."""

import math

import numpy as np
import torch
from jaxtyping import Float
from numpy.typing import NDArray
from torch import Tensor

from pnpct.geometry import ImageGrid, disc_mask
from pnpct.operators import Projector
from pnpct.physics import Weights

_PLACES = 6
"""Along each side, where discs are projected."""
_BATCH = 8
_NOTHING = 1e-9
"""Of the largest sum; what is less is rounding of the convolution where no ray goes."""


def disc_template(diameter: float, spacing: float) -> Float[Tensor, "side side"]:
    """Return the share of each pixel that is inside a disc; its middle is that of the middle pixel.

    Args:
        diameter: Of the disc, mm, > 0.
        spacing: Distance between pixels, mm, > 0.
    """
    side = 2 * math.ceil(diameter / 2 / spacing + 0.5) + 1
    return torch.from_numpy(disc_mask((0.0, 0.0), diameter / 2, ImageGrid(side, side, spacing=spacing))).float()


def sum_around(image: Float[Tensor, "rows cols"], template: Float[Tensor, "side side"]) -> Float[Tensor, "rows cols"]:
    """Return the sum of an image times a symmetric template around each pixel; beyond its border it is 0."""
    return torch.nn.functional.conv2d(image[None, None], template.to(image)[None, None], padding="same")[0, 0]


def disc_information(weights: Weights, projector: Projector, diameter: float) -> Float[Tensor, "rows cols"]:
    """Return qᵀW q of a disc of 1 HU around each pixel, q its projection: 1/variance of its contrast.

    At a distance t from the middle a disc of radius R projects to 2√(R² − t²), and a dome √(R² − r²) to π/2 (R² − t²):
    in proportion to its square. So Σ q²w is the diagonal of AᵀWA, summed under a dome, but for a factor that changes
    by a few per cent across an image. The factor is computed with discs at 36 places, and interpolated.

    Args:
        weights: W, inverse variances.
        projector: A.
        diameter: Of the disc, mm, > 0.

    Returns:
        1/HU², within 6 % (1.5 % root mean square); 0 where the disc is not wholly on the image, and where no ray goes.

    Raises:
        ValueError: If the image is not twice as wide as the disc, or hardly any ray that counts sees it.
    """
    grid = projector.grid
    rim = disc_template(diameter, grid.spacing).shape[0] // 2
    if min(grid.shape) < 4 * rim:
        raise ValueError(
            f"A disc of {diameter:g} mm is tested on images at least twice as wide, got {grid.shape} pixels of "
            f"{grid.spacing:g} mm."
        )
    of_pixels = sum_around(projector.gram_diagonal(weights.diagonal).double(), _dome(diameter, grid.spacing))
    of_pixels = torch.where(of_pixels > _NOTHING * of_pixels.max(), of_pixels, 0.0)
    rows, cols = (np.linspace(rim, size - 1 - rim, _PLACES).round().astype(np.int64) for size in grid.shape)
    places = [(int(row), int(col)) for row in rows for col in cols]
    there = of_pixels.cpu().numpy()[tuple(np.transpose(places))]
    known = there > 1e-3 * there.max()
    if not known.any():
        raise ValueError("A score test needs rays that see the image from all sides, but hardly any has a weight.")
    exact = np.concatenate(
        [_projected(weights, projector, diameter, places[i : i + _BATCH]) for i in range(0, len(places), _BATCH)]
    )
    factors = np.full(len(places), (exact[known] / there[known]).mean())
    factors[known] = exact[known] / there[known]
    factor = _hats(rows, grid.rows) @ factors.reshape(_PLACES, _PLACES) @ _hats(cols, grid.cols).T
    information = torch.zeros_like(of_pixels)
    inside = np.s_[rim : grid.rows - rim, rim : grid.cols - rim]
    information[inside] = of_pixels[inside] * torch.from_numpy(factor).to(of_pixels)[inside]
    return information.to(weights.diagonal)


def _dome(diameter: float, spacing: float) -> Float[Tensor, "side side"]:
    side = disc_template(diameter, spacing).shape[0] // 2
    fine = (np.arange(-5 * side - 2, 5 * side + 3) / 5) * spacing  # 5 samples to a pixel
    height = np.sqrt(np.maximum((diameter / 2) ** 2 - fine[:, None] ** 2 - fine**2, 0.0))
    pixels = 2 * side + 1
    return torch.from_numpy(height.reshape(pixels, 5, pixels, 5).mean(axis=(1, 3)))


def _projected(
    weights: Weights, projector: Projector, diameter: float, places: list[tuple[int, int]]
) -> NDArray[np.float64]:
    grid = projector.grid
    discs = np.stack([disc_mask((grid.x[col], grid.y[row]), diameter / 2, grid) for row, col in places])
    q = projector(torch.from_numpy(discs / 1000).to(weights.diagonal))
    information: NDArray[np.float64] = (q * weights(q)).double().sum(weights.domain_dims).cpu().numpy()
    return information


def _hats(knots: NDArray[np.int64], size: int) -> NDArray[np.float64]:
    """Weights [size, knots] of linear interpolation."""
    return np.stack([np.interp(np.arange(size), knots, unit) for unit in np.eye(knots.size)], axis=1)
