"""Model observers from noise power and transfer alone, as phantoms are judged by."""

import math

import numpy as np
from scipy.special import j1

from pnpct.evaluation.observers.eye_filter import Spectrum
from pnpct.evaluation.observers.noise_power import NoisePower


def matched_filter_d_prime(
    power: NoisePower, transfer: Spectrum, *, contrast_hu: float, diameter: float, eye: Spectrum | None = None
) -> float:
    """Return d′ of a non-prewhitening matched filter for a disc, from the noise power and the task transfer function.

        d′² = [∬ |W|² TTF² E² du dv]² / ∬ |W|² TTF² E⁴ NPS du dv,     W(f) = contrast · πr² · 2 J₁(2πrf) / (2πrf)

    with E = 1 without an eye. Blurring can raise it: it compares settings of one scanner, not methods that smooth.

    Args:
        power: Noise power of the images.
        transfer: Transfer of an edge of about this contrast, at this dose.
        contrast_hu: Contrast of the disc, HU, of either sign.
        diameter: Of the disc, mm, > 0.
        eye: Filter of a reader's eye, such as `EyeFilter()`.

    Returns:
        d′; infinite without noise.

    Raises:
        ValueError: If the contrast is 0 or not finite, or the diameter not positive.

    References:
        AAPM Task Group 233, Med. Phys. 46 (2019) e735, doi 10.1002/mp.13763.
    """
    if not (math.isfinite(contrast_hu) and contrast_hu != 0 and math.isfinite(diameter) and diameter > 0):
        raise ValueError(f"A disc has a contrast in HU and a diameter in mm, got {contrast_hu:g} and {diameter:g}.")
    f, radius = power.radius, diameter / 2
    argument = 2 * math.pi * radius * np.maximum(f, 1e-12)
    disc = contrast_hu * math.pi * radius**2 * 2 * j1(argument) / argument
    seen = np.ones_like(f) if eye is None else eye(f.ravel()).reshape(f.shape)
    signal = (disc * transfer(f.ravel()).reshape(f.shape)) ** 2 * seen**2
    noise = float((signal * seen**2 * power.power).sum()) * power.step**2
    total = float(signal.sum()) * power.step**2
    return total / math.sqrt(noise) if noise > 0 else math.inf
