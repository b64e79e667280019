"""From counts to line integrals and their weights."""

import math
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Literal

import numpy as np
import torch
from jaxtyping import Bool, Float
from numpy.typing import NDArray
from torch import Tensor

from pnpct.arrays import ConeRays, Rays
from pnpct.geometry import ConeBeam, Geometry
from pnpct.geometry.short_repr import short_repr
from pnpct.physics.bone_hardening import BoneHardening
from pnpct.physics.scan import Scan
from pnpct.physics.unmeasured import fill_along_detector
from pnpct.physics.weights import DiagonalWeights, Weights


@dataclass(frozen=True, eq=False)
class Sinogram:
    """Line integrals and the weights of a least-squares fit to them.

    Args:
        line_integrals: y, dimensionless.
        weights: W, the inverse covariance of the line integrals (up to a factor).
        bone: What they lack behind bone; None where that is not known, or added already (`corrected_for_bone`).
        interpolated: Which rays were not measured, so that their line integrals come from those around and their
            weight is 0; broadcasts to the rays. None if none.

    Raises:
        ValueError: If a line integral is not finite, or the weights or the correction for bone are for other rays.
    """

    line_integrals: Rays | ConeRays
    weights: Weights
    bone: BoneHardening | None = None
    interpolated: Bool[Tensor, "..."] | None = field(default=None, repr=False)

    __repr__ = short_repr

    def __post_init__(self) -> None:
        broken = int((~self.line_integrals.isfinite()).sum())
        if broken:
            raise ValueError(
                f"Line integrals must be finite, but {broken} of {self.line_integrals.numel()} are NaN or infinite."
            )
        shape, needed = tuple(self.line_integrals.shape), self.weights.range_shape
        if shape[len(shape) - len(needed) :] != needed:
            raise ValueError(f"The weights are for rays of the shape {needed}, the line integrals have {shape}.")
        if self.bone is not None and self.bone.coefficients.shape[0] not in (1, shape[-1]):
            raise ValueError(
                f"The correction for bone is for {self.bone.coefficients.shape[0]} bins, the line integrals have "
                f"{shape[-1]}."
            )


WIDER = (2.0, 4.0)
"""Times the smoothing of l: so widely are counts smoothed for the weights, where their noise cannot tell."""

BLOCK = 100
"""Sums of neighbouring rays that are made together."""


def take_log(
    scan: Scan,
    *,
    smoothing: float = 1.5,
    low_counts: float = 20.0,
    weight: Literal["statistical", "uniform"] = "statistical",
) -> Sinogram:
    """Turn the counts z of a scan into line integrals, −ln(z/incident) where counts suffice, and weights.

    The logarithm of a few noisy counts is biased, and has no value at all for counts ≤ 0. With l the counts
    smoothed over neighbouring rays and s the electronic noise, let e = l²/(l + s²) be the noise-equivalent
    counts (without electronic noise e = l). Then

        y = ln(incident) − t ln z − (1 − t) (ln l + (z − l)/l),     t = e/low_counts − 1 within [0, 1],

    the logarithm from e = 2 low_counts on and its tangent at l, which has no bias from noise, up to
    low_counts. Below the larger of s and one quantum, both logarithms go on along their tangent, so that y is
    finite for every z: behind lead its mean ends at ln(incident/s) + 1. The tangent takes detail finer than
    the smoothing from starved rays only to first order.

    The weights are 1/variance of y, w = e: of counts that are smoothed still more widely where their noise cannot
    tell, since weights that share the noise of y bias the fit. With a beam-hardening correction h, line integrals are
    h(y) and weights e/h′²; both stay on an absolute scale.

    Rays that were not measured have the weight 0, and take no part in the smoothing. Their line integrals, which only
    FBP uses, are interpolated along the detector.

    Args:
        scan: The scan.
        smoothing: Standard deviation of the Gaussian that gives l, in bins along the detector, and along the
            views as many views, but no further than a point halfway out in the field of view moves by as many
            bins; of a cone beam along the rows instead, so that each view stands alone. 0 for none: each weight
            comes from its own count, and the logarithm reaches down to the larger of s and one quantum.
        low_counts: Noise-equivalent counts up to which the tangent replaces the logarithm, ≥ 0.
        weight: "statistical", or "uniform": the mean of the statistical weights in every ray.

    Returns:
        Line integrals, dimensionless, and weights, 1/variance for "statistical".

    Raises:
        ValueError: If an option is out of range.

    References:
        Thibault et al., Proc. SPIE 6065 (2006) 60650X: positive counts by local averaging, electronic noise
        in the weights; Fu et al., IEEE Trans. Med. Imaging 36 (2017) 707: bias of the logarithm.

    Example:
        >>> from pnpct.geometry import FanBeam, evenly_spaced_views
        >>> geometry = FanBeam(evenly_spaced_views(2), bins=3, source_to_isocenter=541.0,
        ...                    source_to_detector=949.0, bin_width=1.0)
        >>> scan = Scan(torch.full((2, 3), 500.0), torch.tensor(1000.0), electronic_noise=0.0,
        ...             geometry=geometry, mu_water=0.0193)
        >>> sinogram = take_log(scan)
        >>> sinogram.line_integrals[0, 0].item(), sinogram.weights.diagonal[0, 0].item()  # ln 2, 500
        (0.693..., 500.0...)
    """
    for name, value in (("smoothing", smoothing), ("low_counts", low_counts)):
        if not (math.isfinite(value) and value >= 0):
            raise ValueError(f"{name} must be finite and not negative, got {value}.")
    if weight not in ("statistical", "uniform"):
        raise ValueError(f'The weight is "statistical" or "uniform", got "{weight}".')
    measured = scan.measured.to(scan.counts.device)
    counts, incident = scan.counts, scan.incident.to(scan.counts).where(measured, 1.0)
    floor = max(1.0, scan.electronic_noise)
    # Transmissions are smoothed, not counts: tube current and bow-tie filter may change from ray to ray.
    transmission = counts / incident
    smooth = incident * _smooth(transmission, scan.geometry, smoothing, measured)
    equivalent = _noise_equivalent(smooth, scan.electronic_noise)
    weights = _noise_equivalent(_for_weights(smooth, transmission, scan, smoothing, measured), scan.electronic_noise)
    above = smooth.clamp_min(floor)
    tangent = above.log() + (counts - above) / above
    trust = ((equivalent - low_counts) / max(low_counts, torch.finfo(counts.dtype).tiny)).clamp(0.0, 1.0)
    line_integrals = incident.log() - torch.lerp(tangent, _extended_log(counts, floor), trust)
    if scan.beam_hardening is not None:
        slope = scan.beam_hardening.slope((incident / above).log())
        line_integrals, weights = scan.beam_hardening.correct(line_integrals), weights / slope.square()
    if weight == "uniform":
        weights = weights[measured.expand_as(weights)].mean().expand_as(counts)
    interpolated = None
    if not bool(measured.all()):
        interpolated = ~measured
        line_integrals, weights = fill_along_detector(line_integrals, measured), weights.where(measured, 0.0)
    bone = scan.beam_hardening.bone if scan.beam_hardening else None
    return Sinogram(line_integrals, DiagonalWeights(weights, scan.geometry.shape), bone, interpolated)


def _for_weights(
    smooth: Tensor, transmission: Tensor, scan: Scan, smoothing: float, measured: Bool[Tensor, "..."]
) -> Tensor:
    """Smooth counts further wherever that leaves them within three standard deviations of their noise."""
    incident = scan.incident.to(smooth).where(measured, 1.0)
    for times in WIDER:
        neighbours = max(math.pi * (times * smoothing) ** 2, 1.0)  # of a Gaussian of half the width
        wider = incident * _smooth(transmission, scan.geometry, times * smoothing, measured)
        noise = ((wider.clamp_min(0) + scan.electronic_noise**2) / neighbours).sqrt()
        differs = (wider - smooth).abs() / noise.clamp_min(torch.finfo(noise.dtype).tiny)
        smooth = torch.lerp(smooth, wider, (3 - differs).clamp(0, 1))
    return smooth


def _noise_equivalent(counts: Tensor, electronic_noise: float) -> Tensor:
    """l²/(l + s²), the inverse variance of the logarithm; 0 where nothing arrives."""
    positive = counts.clamp_min(torch.finfo(counts.dtype).tiny)
    return positive / (1 + electronic_noise**2 / positive)


def _extended_log(counts: Tensor, start: float) -> Tensor:
    """The logarithm from `start` on, and its tangent there below."""
    return counts.clamp_min(start).log() + (counts / start - 1).clamp_max(0.0)


def _smooth(
    transmission: Rays | ConeRays, geometry: Geometry, smoothing: float, measured: Bool[Tensor, "..."]
) -> Rays | ConeRays:
    """Gaussian means over measured neighbours; as matrices, so that views may come in any order and with gaps."""
    if smoothing == 0:
        return transmission
    over_bins = _neighbours(geometry.bins, smoothing).to(transmission)
    if isinstance(geometry, ConeBeam):
        over_rows = _neighbours(geometry.rows, smoothing).to(transmission)
        return _means(over_rows, transmission, over_bins, measured)
    angles = np.asarray(geometry.view_angles)
    apart = (angles[:, None] - angles + np.pi) % (2 * np.pi) - np.pi
    steps = np.diff(np.unique((angles % (2 * np.pi)).round(9)))
    step = float(np.median(steps)) if steps.size else math.inf
    # Few views are far apart: their neighbours see something else, and would blur the object.
    step = min(step, geometry.bin_width_at_isocenter / (geometry.field_of_view_radius / 2))
    over_views = _gaussian(apart / (smoothing * step)).to(transmission)
    return _means(over_views, transmission, over_bins, measured)


def _means(
    down: Float[Tensor, "r r"], rays: Rays | ConeRays, across: Float[Tensor, "c c"], measured: Bool[Tensor, "..."]
) -> Rays | ConeRays:
    """Weighted means along the last two axes, of the rays that were measured."""

    def sums(rays: Rays | ConeRays) -> Rays | ConeRays:
        return _sums(across, _sums(down, rays, -2), -1)

    if bool(measured.all()):
        return sums(rays)
    shares = sums(measured.to(rays).expand(rays.shape))
    return sums(rays.where(measured, 0.0)) / shares.clamp_min(torch.finfo(rays.dtype).tiny)


def _sums(weights: Float[Tensor, "n n"], rays: Rays | ConeRays, dim: int) -> Rays | ConeRays:
    """Weighted sums along an axis, a block of them at a time, of those rays alone that count in one: most do not."""
    parts = []
    for block in weights.split(BLOCK):
        near = block.any(0).nonzero().squeeze(-1)
        some = rays.index_select(dim, near)
        parts.append(block[:, near] @ some if dim == -2 else some @ block[:, near].T)
    return torch.cat(parts, dim)


@lru_cache(maxsize=8)
def _neighbours(count: int, smoothing: float) -> Float[Tensor, "n n"]:
    numbers = np.arange(count)
    return _gaussian((numbers[:, None] - numbers) / smoothing)


def _gaussian(distances: NDArray[np.float64]) -> Float[Tensor, "n n"]:
    """Weights of the neighbours at the given distances in standard deviations; each row sums to one."""
    weights = np.where(np.abs(distances) <= 3, np.exp(-0.5 * distances**2), 0.0)
    return torch.from_numpy(weights / weights.sum(-1, keepdims=True))
