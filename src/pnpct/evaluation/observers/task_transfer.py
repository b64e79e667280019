"""The task transfer function: how sharp the edge of a disc of a certain contrast is shown."""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray
from torch import Tensor

from pnpct.evaluation.image.hounsfield import hu_array
from pnpct.geometry import ImageGrid
from pnpct.geometry.short_repr import short_repr

STEP = 0.1
"""Width of the radial bins of an edge, pixels."""


@dataclass(frozen=True, eq=False)
class TaskTransfer:
    """A task transfer function, for one contrast at one dose.

    Args:
        frequencies: From 0 to one per pixel, twice the Nyquist frequency, 1/mm.
        transfer: TTF at each, 1 at frequency 0.
        center: Centroid (x, y) of the disc that was found, mm.
        contrast_hu: Disc minus surroundings, HU.
        contrast_to_noise: |contrast| over the standard deviation of the surroundings in the averaged image.
    """

    frequencies: NDArray[np.float64]
    transfer: NDArray[np.float64]
    center: tuple[float, float]
    contrast_hu: float
    contrast_to_noise: float

    __repr__ = short_repr

    def __call__(self, frequencies: NDArray[np.float64]) -> NDArray[np.float64]:
        """Interpolate the function; it is 0 beyond the last of its frequencies (1/mm)."""
        transfer: NDArray[np.float64] = np.interp(frequencies, self.frequencies, self.transfer, right=0.0)
        return transfer

    @property
    def f50(self) -> float:
        """The frequency where it first falls to 50 %, 1/mm; infinite if it does not."""
        return self._falls_to(0.5)

    @property
    def f10(self) -> float:
        """The frequency where it first falls to 10 %, 1/mm; infinite if it does not."""
        return self._falls_to(0.1)

    def _falls_to(self, level: float) -> float:
        below = np.flatnonzero(self.transfer < level)
        if below.size == 0:
            return math.inf
        after = int(below[0])
        high, low = self.transfer[after - 1], self.transfer[after]
        start = self.frequencies[after - 1]
        return float(start + (self.frequencies[after] - start) * (high - level) / (high - low))


def task_transfer(
    images: Float[Tensor, "repeats rows cols"],
    *,
    grid: ImageGrid,
    center: tuple[float, float],
    radius: float,
    least_contrast_to_noise: float = 15.0,
) -> TaskTransfer:
    """Measure the task transfer function on a disc in a uniform surrounding.

    The repeats are averaged, the disc's centroid is found, and the pixels up to twice its radius are sorted by
    their distance r from it into bins of 0.1 pixel: the edge spread function ESF(r), oversampled because the
    edge crosses the pixels at all places. Its derivative under a Hann window centred on the edge is the line
    spread function, and

        TTF(f) = |∫ LSF(r) exp(−2πifr) dr| / |∫ LSF(r) dr|.

    A nonlinear method has another one for every contrast and dose: state both. Frequencies that a pixel cannot
    show are not read, therefore the edge needs no smoothing. The edge is taken as straight, so that the blur
    should be below a quarter of the radius.

    Args:
        images: Repeated scans, attenuation relative to water; averaged noise lowers the error.
        grid: Where the pixels are.
        center: Position (x, y) of the disc, mm, to about a pixel.
        radius: Radius of the disc, mm, at least 4 pixels.
        least_contrast_to_noise: Below it the average is refused, ≥ 0: noise would pass for sharpness.

    Returns:
        The function, with f50 and f10.

    Raises:
        ValueError: If the images are not on the grid or not finite, the disc is too small, twice its radius
            reaches out of the image, or the contrast is too low for the noise.

    References:
        Richard et al., Med. Phys. 39 (2012) 4115, doi 10.1118/1.4725171.
        AAPM Task Group 233, Med. Phys. 46 (2019) e735, doi 10.1002/mp.13763.
    """
    _check_disc(images, grid, center, radius)
    hu = hu_array(images).mean(axis=0)
    center = _centroid(hu, grid, center, radius)
    distance = np.hypot(grid.x[None, :] - center[0], grid.y[:, None] - center[1])
    surroundings = hu[(distance > 1.5 * radius) & (distance < 2 * radius)]
    contrast = float(hu[distance < 0.6 * radius].mean() - surroundings.mean())
    noise = float(surroundings.std())
    ratio = abs(contrast) / noise if noise > 0 else math.inf if contrast else 0.0
    if contrast == 0 or ratio < least_contrast_to_noise:
        raise ValueError(
            f"The edge needs a contrast of {least_contrast_to_noise:g} times the noise of the averaged image, got "
            f"{ratio:.3g}; average more scans or take a stronger insert."
        )
    step = STEP * grid.spacing
    edge = _edge_spread(distance, hu, 2 * radius, step)
    r = (np.arange(edge.size - 1) + 1.0) * step  # between the middles of the bins
    window = np.where(np.abs(r - radius) < radius, np.cos(np.pi * (r - radius) / (2 * radius)) ** 2, 0.0)
    spread = np.diff(edge) * window
    frequencies = np.linspace(0.0, 1.0, 201) / grid.spacing
    transfer = np.abs(np.exp(-2j * np.pi * frequencies[:, None] * r) @ spread)
    return TaskTransfer(frequencies, transfer / transfer[0], center, contrast, ratio)


def _check_disc(images: Tensor, grid: ImageGrid, center: tuple[float, float], radius: float) -> None:
    if tuple(images.shape[-2:]) != grid.shape or images.shape[0] == 0:
        raise ValueError(f"At least one image of {grid.shape} pixels was expected, got {tuple(images.shape)}.")
    if not (math.isfinite(radius) and radius >= 4 * grid.spacing):
        raise ValueError(f"The disc needs a radius of at least 4 pixels ({4 * grid.spacing:g} mm), got {radius} mm.")
    room = min(center[0] - grid.x[0], grid.x[-1] - center[0], center[1] - grid.y[-1], grid.y[0] - center[1])
    if not room >= 2 * radius:
        raise ValueError(
            f"Twice the radius of the disc ({2 * radius:g} mm) must be inside the image, got {room:g} mm to its border."
        )


def _centroid(
    hu: NDArray[np.float64], grid: ImageGrid, center: tuple[float, float], radius: float
) -> tuple[float, float]:
    distance = np.hypot(grid.x[None, :] - center[0], grid.y[:, None] - center[1])
    above = hu - np.median(hu[(distance > 1.5 * radius) & (distance < 2 * radius)])
    above[distance > 1.5 * radius] = 0.0
    total = above.sum()
    if total == 0:
        return center
    x, y = float((above * grid.x).sum() / total), float((above * grid.y[:, None]).sum() / total)
    # Noise in place of a disc can put it anywhere; then the contrast is refused at the given place.
    return (x, y) if math.hypot(x - center[0], y - center[1]) < radius / 2 else center


def _edge_spread(
    distance: NDArray[np.float64], hu: NDArray[np.float64], end: float, step: float
) -> NDArray[np.float64]:
    bins = int(end / step)
    index = (distance / step).astype(np.int64)
    inside = index < bins
    counts = np.bincount(index[inside], minlength=bins)
    filled = counts > 0
    radii = np.bincount(index[inside], weights=distance[inside], minlength=bins)[filled] / counts[filled]
    values = np.bincount(index[inside], weights=hu[inside], minlength=bins)[filled] / counts[filled]
    edge: NDArray[np.float64] = np.interp((np.arange(bins) + 0.5) * step, radii, values)
    return edge
