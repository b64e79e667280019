"""The ramp filter of fan-beam FBP, with its apodisations."""

from itertools import count
from typing import Literal, get_args

import numpy as np
import torch
from numpy.typing import NDArray

from pnpct.arrays import Rays

Kernel = Literal["ram-lak", "shepp-logan", "hann", "soft"]

_SOFT = (1.0, 0.815, 0.4564, 0.1636, 0.0)
"""The "soft" kernel of CatSim's reconstruction at 0, 1/4, 1/2, 3/4 and 1 of the Nyquist frequency."""

_SLICES = 4
"""Slices filtered together: larger temporaries cost more in fresh memory than in arithmetic."""


def ramp_filter(rays: Rays, *, spacing: float, equiangular: bool, kernel: Kernel) -> Rays:
    """Convolve each view with the band-limited ramp.

    With τ the spacing of the bins the ramp is h(0) = 1/4τ², h(kτ) = −1/(πkτ)² for odd k and 0 for even k, times
    (kτ / sin kτ)² where the bins are angles of a fan. Its spectrum is multiplied by a window: none ("ram-lak"),
    sinc(f/2f_N) ("shepp-logan"), cos²(πf/2f_N) ("hann"), or the curve, flat at f = 0, through the five
    points that CatSim calls "soft", f_N = 1/2τ.

    Args:
        rays: Weighted line integrals.
        spacing: Spacing of the bins, rad or mm, > 0.
        equiangular: Whether the spacing is an angle.
        kernel: Name of the window.

    Returns:
        The convolution, in the unit of the rays per unit of the spacing.

    Raises:
        ValueError: If the kernel is unknown.

    References:
        Kak and Slaney, Principles of Computerized Tomographic Imaging (2001), Eqs. 3.29 to 3.31 and 3.92.
    """
    if kernel not in get_args(Kernel):
        raise ValueError(f'The kernel is one of {", ".join(get_args(Kernel))}, got "{kernel}".')
    bins = rays.shape[-1]
    length = _fast_length(2 * bins - 1)
    response = torch.from_numpy(_response(bins, length, spacing, equiangular, kernel)).to(rays)
    filtered = torch.empty_like(rays).reshape(-1, *rays.shape[-2:])
    for first in range(0, len(filtered), _SLICES):
        part = slice(first, first + _SLICES)
        spectrum = torch.fft.rfft(rays.reshape(filtered.shape)[part], length)
        filtered[part] = torch.fft.irfft(spectrum.mul_(response), length)[..., :bins]
    return filtered.reshape(rays.shape)


def _fast_length(least: int) -> int:
    """The next number without prime factors above 5, which a Fourier transform is fast for."""
    return next(length for length in count(least) if 30 ** length.bit_length() % length == 0)


def _soft(frequency: NDArray[np.float64]) -> NDArray[np.float64]:
    """The cubic spline through the points, flat at 0 and one cubic over the last two intervals, by its slopes there.

    SciPy's takes longer to load than a slice takes to reconstruct.
    """
    y, intervals = np.array(_SOFT), len(_SOFT) - 1
    smooth = np.eye(intervals + 1) * 4 + np.eye(intervals + 1, k=1) + np.eye(intervals + 1, k=-1)
    rises = np.zeros(intervals + 1)
    rises[1:-1] = 3 * (y[2:] - y[:-2])
    smooth[0], smooth[-1] = np.eye(intervals + 1)[0], np.eye(intervals + 1)[-3] - np.eye(intervals + 1)[-1]
    rises[-1] = 2 * (2 * y[-2] - y[-3] - y[-1])
    slopes = np.linalg.solve(smooth, rises)
    left = np.minimum((frequency * intervals).astype(int), intervals - 1)
    t = frequency * intervals - left
    chord = y[left + 1] - y[left]
    bend = (1 - t) * (slopes[left] - chord) - t * (slopes[left + 1] - chord)
    curve: NDArray[np.float64] = y[left] + t * chord + t * (1 - t) * bend
    return curve


def _response(bins: int, length: int, spacing: float, equiangular: bool, kernel: Kernel) -> NDArray[np.float64]:
    """Return the real spectrum of the kernel, times the spacing that stands for the integral."""
    k = np.arange(1, bins, 2)
    distance = np.sin(k * spacing) if equiangular else k * spacing
    ramp = np.zeros(length)
    ramp[0] = 1 / (4 * spacing**2)
    ramp[k] = ramp[-k] = -1 / (np.pi * distance) ** 2
    frequency = np.arange(length // 2 + 1) / (length / 2)  # 1 is Nyquist
    window = {
        "ram-lak": lambda f: np.ones_like(f),
        "shepp-logan": lambda f: np.sinc(f / 2),
        "hann": lambda f: np.cos(np.pi * f / 2) ** 2,
        "soft": _soft,
    }[kernel]
    response: NDArray[np.float64] = np.fft.rfft(ramp).real * spacing * window(frequency)
    return response
