"""The noise power spectrum: how much noise an image has at each spatial frequency."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray
from torch import Tensor

from pnpct.evaluation.image.patches import Patch, patch_values, tile_patches
from pnpct.geometry.short_repr import short_repr


@dataclass(frozen=True, eq=False)
class RadialPower:
    """A noise power spectrum averaged over rings of frequency.

    Args:
        frequencies: Middle of each ring, 1/mm, from 0 to the Nyquist frequency.
        power: Mean over the ring, HU² mm².
    """

    frequencies: NDArray[np.float64]
    power: NDArray[np.float64]

    __repr__ = short_repr

    @property
    def mean_frequency(self) -> float:
        """Σ f NPS(f) / Σ NPS(f), 1/mm: lower is coarser noise; compare it with that of FBP."""
        total = float(self.power.sum())
        return float((self.frequencies * self.power).sum()) / total if total > 0 else math.nan

    @property
    def peak_frequency(self) -> float:
        """The frequency of the largest power, 1/mm."""
        return float(self.frequencies[int(np.argmax(self.power))])


@dataclass(frozen=True, eq=False)
class NoisePower:
    """A two-dimensional noise power spectrum.

    Args:
        frequencies: Frequencies of both axes, 1/mm, rising, with 0 in the middle.
        power: NPS, HU² mm², [frequencies of the rows, of the columns].
    """

    frequencies: NDArray[np.float64]
    power: NDArray[np.float64]

    __repr__ = short_repr

    @property
    def step(self) -> float:
        """Distance between frequencies, 1/mm."""
        return float(self.frequencies[1] - self.frequencies[0])

    @property
    def variance(self) -> float:
        """∫∫ NPS(u, v) du dv, HU²: the variance of the noise, by Parseval."""
        return float(self.power.sum()) * self.step**2

    @property
    def radius(self) -> NDArray[np.float64]:
        """√(u² + v²) of every frequency, 1/mm."""
        radius: NDArray[np.float64] = np.hypot(self.frequencies[:, None], self.frequencies)
        return radius

    def radial(self) -> RadialPower:
        """Average over rings one step wide, up to the Nyquist frequency; the corners beyond it stay out."""
        rings = self.frequencies.size // 2 + 1
        ring = np.rint(self.radius / self.step).astype(np.int64).ravel()
        inside = ring < rings
        sums = np.bincount(ring[inside], weights=self.power.ravel()[inside], minlength=rings)
        counts = np.bincount(ring[inside], minlength=rings)
        return RadialPower(np.arange(rings, dtype=np.float64) * self.step, (sums / counts).astype(np.float64))


def noise_power_of_repeats(
    repeats: Float[Tensor, "repeats rows cols"],
    *,
    spacing: float,
    size: int = 64,
    patches: Sequence[Patch] | None = None,
) -> NoisePower:
    """Measure the noise power spectrum on repeated scans of one object.

    With M repeats and N × N pixels of the side d in a patch,

        NPS(u, v) = M/(M − 1) · d²/N² · mean |DFT(patch − mean of the repeats)|²

    over repeats and patches. Whatever all repeats have in common falls out. Two repeats are the difference
    method: NPS = d²/N² · mean |DFT(first − second)|² / 2.

    Args:
        repeats: Two or more images of independent noise, attenuation relative to water.
        spacing: Distance d between pixels, mm, positive.
        size: Side N of the patches, pixels, at least 2.
        patches: Where; patches side by side over the whole image if None. Noise that changes over the image
            is averaged.

    Returns:
        The spectrum.

    Raises:
        ValueError: If there are fewer than two repeats, a patch does not fit, or a number is out of its range.

    References:
        AAPM Task Group 233, Med. Phys. 46 (2019) e735, doi 10.1002/mp.13763.

    Example:
        >>> import torch
        >>> white = 1 + 0.01 * torch.randn(8, 64, 64, generator=torch.Generator().manual_seed(1))
        >>> round(noise_power_of_repeats(white, spacing=0.5).variance / 100, 1)
        1.0
    """
    count = repeats.shape[0]
    if count < 2:
        raise ValueError(f"Two repeats or more are needed, got {count}; noise_power_of_one takes a single image.")
    cut = _cut(repeats, spacing, size, patches)
    return _spectrum((cut - cut.mean(axis=0)) * math.sqrt(count / (count - 1)), spacing)


def noise_power_of_one(
    image: Float[Tensor, "rows cols"],
    *,
    spacing: float,
    size: int = 64,
    patches: Sequence[Patch] | None = None,
) -> NoisePower:
    """Measure the noise power spectrum on one image of a uniform object.

    As `noise_power_of_repeats`, but what is subtracted is a polynomial of second order in x and y, fitted to
    each patch: it takes out cupping and gradients, no anatomy. The power next to frequency 0 goes with it.

    Args:
        image: Attenuation relative to water.
        spacing: Distance between pixels, mm, positive.
        size: Side of the patches, pixels, at least 3.
        patches: Where the object is uniform; side by side over the whole image if None.

    Returns:
        The spectrum.

    Raises:
        ValueError: If a patch does not fit or a number is out of its range.

    References:
        AAPM Task Group 233, Med. Phys. 46 (2019) e735, doi 10.1002/mp.13763.
    """
    if size < 3:
        raise ValueError(f"A polynomial of second order needs patches of at least 3 x 3 pixels, got {size}.")
    cut = _cut(image, spacing, size, patches)
    y, x = (axis.ravel() for axis in np.meshgrid(*2 * [np.linspace(-1.0, 1.0, size)], indexing="ij"))
    terms, _ = np.linalg.qr(np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1))
    flat = cut.reshape(-1, size * size)
    return _spectrum((flat - flat @ terms @ terms.T).reshape(cut.shape), spacing)


def _cut(
    images: Float[Tensor, "..."], spacing: float, size: int, patches: Sequence[Patch] | None
) -> NDArray[np.float64]:
    if not (math.isfinite(spacing) and spacing > 0):
        raise ValueError(f"The distance between pixels must be a positive length in mm, got {spacing}.")
    if size < 2:
        raise ValueError(f"A spectrum needs patches of at least 2 x 2 pixels, got {size}.")
    shape = (images.shape[-2], images.shape[-1])
    return patch_values(images, tile_patches(shape, size=size) if patches is None else patches, size)


def _spectrum(noise: NDArray[np.float64], spacing: float) -> NoisePower:
    size = noise.shape[-1]
    squares = np.abs(np.fft.fft2(noise)) ** 2
    power = squares.reshape(-1, size, size).mean(axis=0) * (spacing / size) ** 2
    return NoisePower(np.fft.fftshift(np.fft.fftfreq(size, spacing)), np.fft.fftshift(power))
