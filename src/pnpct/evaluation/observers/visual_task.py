"""What is looked for and by which eye: task functions, the eye filter, and detectability from spectra."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.special import j1

from pnpct.evaluation.observers.noise_power import NoisePower

Spectrum: TypeAlias = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""From frequencies in 1/mm to a value at each."""


@dataclass(frozen=True)
class EyeFilter:
    """The contrast sensitivity of a reader at a distance from a screen.

    E(ρ) = |ρ^1.5 exp(−c ρ^0.68)|² / max, with ρ = f · distance · π/180 / zoom in cycles per degree. State
    distance and zoom with the result.

    Args:
        distance: From the eye to the screen, mm, positive.
        zoom: Size on the screen over size in the patient, positive.
        decay: The constant c, positive: 0.98 (Eckstein) or 3.22 (Saunders).

    Raises:
        ValueError: If a number is not positive.

    References:
        AAPM Task Group 233, Med. Phys. 46 (2019) e735, doi 10.1002/mp.13763.

    Example:
        >>> EyeFilter()(np.array([0.0])).tolist()
        [0.0]
    """

    distance: float = 500.0
    zoom: float = 1.0
    decay: float = 0.98

    def __post_init__(self) -> None:
        for name, value in (("distance", self.distance), ("zoom", self.zoom), ("decay", self.decay)):
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"The {name} of an eye filter must be positive, got {value}.")

    def __call__(self, frequencies: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return E, 0 to 1, at frequencies in 1/mm."""
        peak = (1.5 / (0.68 * self.decay)) ** (1 / 0.68)
        rho = np.abs(frequencies) * self.distance * math.pi / 180 / self.zoom
        response = rho**1.5 * np.exp(-self.decay * rho**0.68)
        squared: NDArray[np.float64] = (response / (peak**1.5 * math.exp(-self.decay * peak**0.68))) ** 2
        return squared


@dataclass(frozen=True)
class DiscTask:
    """The task of finding a disc: its Fourier transform.

    W(f) = contrast · π R² · 2 J₁(2πRf) / (2πRf).

    Args:
        diameter: 2R, mm, positive.
        contrast_hu: Of the disc against its surroundings, HU.

    Raises:
        ValueError: If the diameter is not positive or a number is not finite.

    Example:
        >>> DiscTask(diameter=2.0, contrast_hu=1.0)(np.array([0.0])).round(6).tolist()
        [3.141593]
    """

    diameter: float
    contrast_hu: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.diameter) and self.diameter > 0 and math.isfinite(self.contrast_hu)):
            raise ValueError(
                f"A disc needs a positive diameter in mm and a contrast in HU, got {self.diameter} and "
                f"{self.contrast_hu}."
            )

    def __call__(self, frequencies: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return W in HU mm² at frequencies in 1/mm."""
        argument = math.pi * self.diameter * np.abs(frequencies)
        safe = np.where(argument > 0, argument, 1.0)
        area = math.pi * self.diameter**2 / 4
        task: NDArray[np.float64] = self.contrast_hu * area * np.where(argument > 0, 2 * j1(safe) / safe, 1.0)
        return task


def spectral_detectability(
    task: Spectrum, transfer: Spectrum, noise: NoisePower, *, eye: Spectrum | None = None
) -> float:
    """Return the detectability index of a non-prewhitening observer from its spectra.

    d′² = [∫∫ |W|² TTF² E²]² / ∫∫ |W|² TTF² E⁴ NPS,

    over all frequencies of the noise power spectrum. This observer is fooled: it rewards plain blurring, which
    leaves a Hotelling observer where it was. Show it only beside blurred FBP.

    Args:
        task: W, HU mm², say a `DiscTask`.
        transfer: TTF, say a `TaskTransfer` of the same contrast and dose.
        noise: The noise power spectrum; its frequency step must resolve the task (patch ≥ twice the disc).
        eye: E, say an `EyeFilter`; None is NPW, without an eye.

    Returns:
        d′, no unit.

    Raises:
        ValueError: If there is no noise at the task's frequencies.

    References:
        AAPM Task Group 233, Med. Phys. 46 (2019) e735, doi 10.1002/mp.13763.
    """
    frequencies = noise.radius
    seen = (task(frequencies) * transfer(frequencies)) ** 2
    squared_eye = np.ones_like(seen) if eye is None else eye(frequencies) ** 2
    signal = float((seen * squared_eye).sum()) * noise.step**2
    variance = float((seen * squared_eye**2 * noise.power).sum()) * noise.step**2
    if not variance > 0:
        raise ValueError("Detectability needs noise at the frequencies of the task; the power there is 0.")
    return signal / math.sqrt(variance)
