"""Model observers: how well a known lesion is found in noise, from images with and without it."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray
from scipy.special import eval_laguerre, ndtri
from scipy.stats import rankdata
from torch import Tensor

from pnpct.evaluation.image.hounsfield import hu_array
from pnpct.evaluation.intervals import Interval
from pnpct.evaluation.observers.eye_filter import Spectrum

Array: TypeAlias = NDArray[np.float64]

Observer: TypeAlias = Callable[[Array, Array], tuple[Array, Array]]
"""From how often each image (present, absent) is trained with, [batch, images], to the scores of all images."""


@dataclass(frozen=True)
class Detectability:
    """How well an observer tells images with a lesion from those without.

    Args:
        d_prime: d′ with its interval; no unit.
        auc: Probability that an image with lesion scores higher than one without, 0 to 1. It saturates: compare
            by d′.
        pairs: Images of each kind.
    """

    d_prime: Interval
    auc: float
    pairs: int


def laguerre_gauss_channels(size: int, *, spacing: float, diameter: float, channels: int = 5) -> Array:
    """Return Laguerre-Gauss channels, centred in a square patch.

    uⱼ(r) = (√2/h) exp(−πr²/h²) Lⱼ(2πr²/h²), with h = 2/3 of the diameter of the lesion.

    Args:
        size: Side of the patch, pixels, at least 1.
        spacing: Distance between pixels, mm, positive.
        diameter: Of the lesion, mm, positive.
        channels: How many, j = 0 ... channels − 1, at least 1.

    Returns:
        The channels, 1/mm, [channels, size, size].

    Raises:
        ValueError: If a number is out of its range.

    References:
        Gallas and Barrett, J. Opt. Soc. Am. A 20 (2003) 1725.
    """
    if size < 1 or channels < 1 or not (spacing > 0 and diameter > 0):
        raise ValueError(
            f"Channels need a size, number, spacing and diameter above 0, got {size}, {channels}, {spacing} and "
            f"{diameter}."
        )
    h = 2 * diameter / 3
    along = (np.arange(size) - (size - 1) / 2) * spacing
    squares = (along[:, None] ** 2 + along**2) / h**2
    profiles = [eval_laguerre(j, 2 * math.pi * squares) for j in range(channels)]
    return np.stack(profiles) * math.sqrt(2) / h * np.exp(-math.pi * squares)


def channelised_hotelling(
    present: Float[Tensor, "pairs side side"],
    absent: Float[Tensor, "pairs side side"],
    *,
    spacing: float,
    diameter: float,
    generator: np.random.Generator,
    channels: int = 5,
    splits: int = 10,
    resamples: int = 500,
) -> Detectability:
    """Measure d′ of a channelised Hotelling observer with Laguerre-Gauss channels.

    The mean of each patch is removed and the channels applied, v = Uᵀg. Trained on one half of the images,
    w = S⁻¹(v̄₁ − v̄₀) with S the mean of the covariances of the two kinds; tested on the other half, t = wᵀv and

        d′ = (t̄₁ − t̄₀) / √((var t₁ + var t₀)/2),

    averaged over random splits. Since it decorrelates the noise, blurring gains it nothing: dose is compared by
    this observer.

    Args:
        present: Patches with the lesion in the middle, attenuation relative to water; about twice its diameter.
        absent: As many patches of the same place without it.
        spacing: Distance between pixels, mm, positive.
        diameter: Of the lesion, mm, positive; h of the channels is 2/3 of it.
        generator: Source of splits and resamples.
        channels: Number of channels, at least 1.
        splits: Random splits into halves, at least 1.
        resamples: Bootstrap resamples of the images, at least 2. An image drawn twice is never trained and
            tested with.

    Returns:
        d′ with its 95 % interval (d′ ± 1.96 bootstrap standard errors), and the area under the ROC curve.

    Raises:
        ValueError: If there are fewer than eight pairs per channel (100 are advised), a number is not finite or
            out of its range, or the noise has no variance.

    References:
        Gallas and Barrett, J. Opt. Soc. Am. A 20 (2003) 1725.
        Yu et al., Med. Phys. 40 (2013) 041908: agreement with readers in CT.
    """
    pairs, side = present.shape[0], present.shape[-1]
    u = laguerre_gauss_channels(side, spacing=spacing, diameter=diameter, channels=channels).reshape(channels, -1)
    if pairs < 8 * channels:  # with less, a resample of a half may hold too few images for a covariance
        raise ValueError(f"{channels} channels need at least {8 * channels} pairs of images, got {pairs}.")
    v = _centred(_flat(present, absent)) @ u.T
    _check_varies(v, pairs)
    hotelling = _hotelling(v[:pairs], v[pairs:])
    return _detectability(hotelling, pairs, splits=splits, resamples=resamples, generator=generator)


def matched_filter(
    present: Float[Tensor, "pairs side side"],
    absent: Float[Tensor, "pairs side side"],
    *,
    signal: Float[Tensor, "side side"],
    spacing: float,
    generator: np.random.Generator,
    eye: Spectrum | None = None,
    resamples: int = 500,
) -> Detectability:
    """Measure d′ of a non-prewhitening observer, with an eye (NPWE) or without (NPW).

    The template is the expected difference of the two kinds, filtered twice by the eye: DFT(w) = E² DFT(s), and
    t = wᵀg. d′ is as for `channelised_hotelling`. It rewards blurring: show it only beside blurred FBP.

    Args:
        present: Patches with the lesion, attenuation relative to water.
        absent: As many patches of the same place without it.
        signal: The expected difference s, in any unit, from other images than these: noise that they share would
            pass for signal, and noise of its own lowers d′, much so where the eye looks beside the signal.
        spacing: Distance between pixels, mm, positive.
        generator: Source of the resamples.
        eye: E of a frequency in 1/mm, say an `EyeFilter`; None is NPW.
        resamples: Bootstrap resamples of the images, at least 2.

    Returns:
        d′ with its 95 % interval (d′ ± 1.96 bootstrap standard errors), and the area under the ROC curve.

    Raises:
        ValueError: If there are fewer than eight pairs (100 are advised), a number is not finite or out of its
            range, the signal is 0 everywhere, or the noise has no variance.

    References:
        Burgess, J. Opt. Soc. Am. A 11 (1994) 1237.
    """
    pairs, side = present.shape[0], present.shape[-1]
    if pairs < 8:
        raise ValueError(f"A matched filter needs at least 8 pairs of images, got {pairs}.")
    if not (math.isfinite(spacing) and spacing > 0):
        raise ValueError(f"The distance between pixels must be a positive length in mm, got {spacing}.")
    if not (bool(signal.isfinite().all()) and bool(signal.any())):
        raise ValueError("The expected signal must be finite and not 0 everywhere.")
    images = _flat(present, absent)
    _check_varies(images, pairs)
    along = np.fft.fftfreq(side, spacing)
    squared_eye = np.ones((side, side)) if eye is None else eye(np.hypot(along[:, None], along)) ** 2
    template = np.fft.ifft2(np.fft.fft2(signal.detach().double().cpu().numpy()) * squared_eye).real
    t1, t0 = (images @ template.ravel()).reshape(2, pairs)
    return _detectability(lambda *_: (t1[None], t0[None]), pairs, splits=0, resamples=resamples, generator=generator)


def _flat(present: Tensor, absent: Tensor) -> Array:
    images = np.concatenate([hu_array(present), hu_array(absent)])
    return images.reshape(images.shape[0], -1)


def _centred(images: Array) -> Array:
    centred: Array = images - images.mean(axis=1, keepdims=True)
    return centred


def _check_varies(values: Array, pairs: int) -> None:
    if not (np.ptp(values[:pairs], axis=0).any() and np.ptp(values[pairs:], axis=0).any()):
        raise ValueError("The images of one kind are all the same; detectability needs independent noise in each.")


def _moments(counts: Array, values: Array) -> tuple[Array, Array]:
    """Mean [batch, channels] and covariance of values [images, channels] that count several times."""
    total = counts.sum(axis=1, keepdims=True)
    mean = counts @ values / total
    products = (values[:, :, None] * values[:, None, :]).reshape(values.shape[0], -1)
    second = (counts @ products / total).reshape(-1, values.shape[1], values.shape[1])
    return mean, second - mean[:, :, None] * mean[:, None, :]


def _hotelling(v1: Array, v0: Array) -> Observer:
    middle = (v1.mean(axis=0) + v0.mean(axis=0)) / 2  # of no effect but on rounding
    v1, v0 = v1 - middle, v0 - middle

    def score(counts1: Array, counts0: Array) -> tuple[Array, Array]:
        (mean1, cov1), (mean0, cov0) = _moments(counts1, v1), _moments(counts0, v0)
        w = np.linalg.solve((cov1 + cov0) / 2, (mean1 - mean0)[:, :, None])[:, :, 0]
        return w @ v1.T, w @ v0.T

    return score


def _d_prime(t1: Array, t0: Array, counts1: Array, counts0: Array) -> Array:
    def moments(t: Array, counts: Array) -> tuple[Array, Array]:
        total = counts.sum(axis=1)
        mean = (counts * t).sum(axis=1) / total
        return mean, (counts * (t - mean[:, None]) ** 2).sum(axis=1) / (total - 1)

    (mean1, var1), (mean0, var0) = moments(t1, counts1), moments(t0, counts0)
    value: Array = (mean1 - mean0) / np.sqrt((var1 + var0) / 2)
    return value


def _auc(t1: Array, t0: Array) -> float:
    """Mann-Whitney: the share of pairs in the right order, ties half."""
    ranks = rankdata(np.concatenate([t1, t0]))[: t1.size].sum()
    return float((ranks - t1.size * (t1.size + 1) / 2) / (t1.size * t0.size))


def _detectability(
    observer: Observer, pairs: int, *, splits: int, resamples: int, generator: np.random.Generator, level: float = 0.95
) -> Detectability:
    """No splits: every image is trained and tested with."""
    if resamples < 2 or splits < 0:
        raise ValueError(f"Two resamples or more and splits are needed, got {resamples} and {splits}.")
    once = np.ones((1, pairs))
    drawn1, drawn0 = (generator.multinomial(pairs, np.full(pairs, 1 / pairs), size=resamples) for _ in range(2))
    # The first row is every image once: the estimate. The others are the resamples.
    counts1, counts0 = np.concatenate([once, drawn1]), np.concatenate([once, drawn0])
    masks = [np.ones((2, 2, pairs), dtype=bool)]
    if splits:
        halves = [generator.permuted(np.tile(np.arange(pairs) < pairs // 2, (2, 1)), axis=1) for _ in range(splits)]
        masks = [np.stack([half, ~half]) for half in halves]
    values, areas = np.zeros(resamples + 1), []
    for train, test in masks:
        t1, t0 = observer(counts1 * train[0], counts0 * train[1])
        values += _d_prime(t1, t0, counts1 * test[0], counts0 * test[1]) / len(masks)
        areas.append(_auc(t1[0, test[0]], t0[0, test[1]]))
    # Resamples train with fewer different images, so their mean is below the estimate; their spread is what counts.
    estimate, error = float(values[0]), float(values[1:].std(ddof=1))
    half_width = float(ndtri((1 + level) / 2)) * error
    interval = Interval(estimate, estimate - half_width, estimate + half_width, standard_error=error, level=level)
    return Detectability(interval, auc=float(np.mean(areas)), pairs=pairs)
