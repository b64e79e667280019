"""Scans: what the detector counted, and how to draw it."""

import math
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from pnpct.arrays import ConeRays, Rays
from pnpct.geometry import FanBeam, Geometry, Views, view_numbers
from pnpct.geometry.short_repr import short_repr
from pnpct.operators.threads import parallel
from pnpct.physics.beam_hardening import BeamHardening
from pnpct.physics.noise_kernels import draw_counts

LOWEST_COUNT = -8.0
"""Counts further below 0 than so many standard deviations of the electronic noise are errors: once in 1e15 rays."""

_LARGEST_NOISE = 1e18  # as any count; its square is a number in single precision too


@dataclass(frozen=True, eq=False)
class Scan:
    """What a scanner measured with one geometry: a slice, or what several detector rows saw of a patient.

    A batch are noise realisations, or objects that have nothing to do with each other. `scan[...]` is the scan of a
    subset of the views.

    Counts are in quanta: the unit in which the variance of a ray without object and electronic noise is its mean. A
    detector that counts photons has them; for one that integrates energy a quantum is ⟨E²⟩/⟨E⟩ of the detected
    spectrum, see `Moments`. The dark signal is subtracted already, so that electronic noise may take a count below 0.

    Args:
        counts: What each ray counted, quanta.
        incident: What each ray would have counted without object, quanta, > 0, or 0 where a ray was not measured: one
            number, one per bin, one per view as (views, 1), or one per ray; with detector rows whatever broadcasts to
            (views, rows, bins).
        electronic_noise: Standard deviation of the electronic noise of a count, quanta, ≥ 0.
        geometry: Where the rays are.
        mu_water: Attenuation of water at the effective energy (after the beam-hardening correction), 1/mm.
        beam_hardening: Correction of the line integrals; None where there is none to do.

    Raises:
        ValueError: If the parts do not fit each other, or a number is out of range.

    Example:
        >>> from pnpct.geometry import evenly_spaced_views
        >>> geometry = FanBeam(evenly_spaced_views(2), bins=3, source_to_isocenter=541.0,
        ...                    source_to_detector=949.0, bin_width=1.0)
        >>> scan = Scan(torch.full((2, 3), 500.0), torch.tensor(1000.0), electronic_noise=3.0,
        ...             geometry=geometry, mu_water=0.0193)
        >>> scan.incident.item()
        1000.0
    """

    counts: Rays | ConeRays
    incident: Float[Tensor, "..."]
    electronic_noise: float
    geometry: Geometry
    mu_water: float
    beam_hardening: BeamHardening | None = None

    __repr__ = short_repr

    def __post_init__(self) -> None:
        if not (self.counts.is_floating_point() and self.incident.is_floating_point()):
            raise ValueError(
                f"Counts and incident must be floating-point arrays, got {self.counts.dtype} and "
                f"{self.incident.dtype}; convert them with .float()."
            )
        shape: tuple[int, ...] = self.geometry.shape
        axes = "(views, bins)" if len(shape) == 2 else "(views, rows, bins)"
        if tuple(self.counts.shape[self.counts.ndim - len(shape) :]) != shape:
            raise ValueError(f"Counts must end in {axes} = {shape}, got {tuple(self.counts.shape)}.")
        if not _broadcasts(self.incident, shape):
            raise ValueError(f"incident must broadcast to {axes} = {shape}, got {tuple(self.incident.shape)}.")
        if not bool((self.incident.isfinite() & (self.incident >= 0)).all()) or not bool(self.incident.any()):
            raise ValueError(
                "incident must be positive and finite, or 0 where a ray was not measured; its values go from "
                f"{float(self.incident.min()):.6g} to {float(self.incident.max()):.6g}."
            )
        _not_negative("electronic_noise", self.electronic_noise)
        if not (math.isfinite(self.mu_water) and self.mu_water > 0):
            raise ValueError(f"mu_water must be a positive attenuation in 1/mm, got {self.mu_water}.")
        _check_counts(self.counts, self.electronic_noise)
        if self.beam_hardening and self.beam_hardening.coefficients.shape[0] not in (1, self.geometry.bins):
            raise ValueError(
                f"The beam-hardening correction is for {self.beam_hardening.coefficients.shape[0]} bins, the "
                f"scan has {self.geometry.bins}."
            )

    @property
    def measured(self) -> Bool[Tensor, "..."]:
        """Whether each ray was measured; it broadcasts like `incident`."""
        return self.incident > 0

    def __getitem__(self, views: Views) -> "Scan":
        numbers = torch.from_numpy(view_numbers(views, self.geometry.views)).to(self.counts.device)
        axis = -len(self.geometry.shape)
        per_view = self.incident.ndim >= -axis and self.incident.shape[axis] > 1
        return replace(
            self,
            counts=self.counts.index_select(axis, numbers),
            incident=self.incident.index_select(axis, numbers.to(self.incident.device)) if per_view else self.incident,
            geometry=self.geometry[views],
        )


@dataclass(frozen=True, eq=False)
class Moments:
    """The mean and variance of a noise-free scan at a reference dose, from which noise is drawn at any dose.

    With λ(E) the photons of energy E that a ray detects, an energy-integrating detector has the signal moments
    S₁ = Σ_E λ E and S₂ = Σ_E λ E². Both are proportional to the dose, so one polychromatic simulation serves all.

    Args:
        signal_mean: S₁ of each ray, ≥ 0, in units of the signal (keV, say).
        signal_variance: S₂ of each ray, ≥ 0, in the signal's unit squared.
        air_mean: S₁ without object, > 0; it broadcasts to (views, bins).
        air_variance: S₂ without object, > 0; it broadcasts to (views, bins).
        electronic_noise: Standard deviation of the electronic noise in units of the signal, ≥ 0, at every dose.
            A noise in electrons is divided by the detector's gain first.

    Raises:
        ValueError: If a moment is not finite, negative (for air: not positive), or a variance has no mean.

    References:
        Whiting et al., Med. Phys. 33 (2006) 3290: compound Poisson statistics of CT signals.
    """

    signal_mean: Rays
    signal_variance: Rays
    air_mean: Float[Tensor, "..."]
    air_variance: Float[Tensor, "..."]
    electronic_noise: float = 0.0

    __repr__ = short_repr

    def __post_init__(self) -> None:
        shape = self.signal_mean.shape
        if self.signal_variance.shape != shape:
            raise ValueError(
                f"The mean and the variance must have one shape, got {tuple(shape)} and "
                f"{tuple(self.signal_variance.shape)}."
            )
        for name, signal in (("signal_mean", self.signal_mean), ("signal_variance", self.signal_variance)):
            if not bool((signal.isfinite() & (signal >= 0)).all()):
                raise ValueError(f"{name} must be finite and not negative in every ray.")
        if bool(((self.signal_mean > 0) != (self.signal_variance > 0)).any()):
            raise ValueError("Every ray must have both a mean and a variance above zero, or neither.")
        for name, air in (("air_mean", self.air_mean), ("air_variance", self.air_variance)):
            if not _broadcasts(air, tuple(shape[-2:])):
                raise ValueError(f"{name} must broadcast to {tuple(shape[-2:])}, got {tuple(air.shape)}.")
            _positive(name, air)
        _not_negative("electronic_noise", self.electronic_noise)

    @property
    def quantum(self) -> Float[Tensor, "..."]:
        """Signal per quantum, S₂/S₁ without object: in this unit the variance of air is its mean."""
        return self.air_variance / self.air_mean


def simulate_counts(
    line_integrals: Rays,
    incident: Float[Tensor, "..."],
    *,
    electronic_noise: float = 0.0,
    generator: torch.Generator,
) -> Rays:
    """Draw the counts of a beam of one energy: Poisson(incident · exp(−p)) + Normal(0, electronic_noise²).

    Args:
        line_integrals: p, dimensionless, finite.
        incident: Mean count without object, quanta, > 0.
        electronic_noise: Standard deviation of the electronic noise, quanta, ≥ 0.
        generator: Generator of the noise, on the device of the line integrals.

    Returns:
        Counts in quanta; whole numbers if there is no electronic noise.

    Raises:
        ValueError: If a number is out of range.

    Example:
        >>> generator = torch.Generator().manual_seed(0)
        >>> counts = simulate_counts(torch.ones(10, 100), torch.tensor(1000.0), generator=generator)
        >>> round(counts.mean().item())  # 1000/e
        367
    """
    if not bool(line_integrals.isfinite().all()):
        raise ValueError("Counts are drawn from finite line integrals; some are NaN or infinite.")
    _positive("incident", incident)
    _not_negative("electronic_noise", electronic_noise)
    expected = incident.to(line_integrals) * torch.exp(-line_integrals)
    ones = torch.ones(1).to(expected)
    return _noisy(expected, ones, electronic_noise * ones, generator)


def scan_from_moments(
    moments: Moments,
    geometry: FanBeam,
    *,
    mu_water: float,
    dose_fraction: float = 1.0,
    beam_hardening: BeamHardening | None = None,
    generator: torch.Generator | None,
) -> Scan:
    """Draw a scan of an energy-integrating detector at some fraction of the reference dose.

    The signal is a compound Poisson variable, drawn as the scaled Poisson variable of the same mean and variance,

        signal = S₂/S₁ · Poisson(dose_fraction · S₁²/S₂) + Normal(0, electronic_noise²),

    and stated in quanta of air: counts = signal / q with q = S₂/S₁ of air, incident = dose_fraction · S₁/q of air. A
    hardened beam then has a variance a little above its mean (up to a fifth behind a chest at 120 kVp).

    Args:
        moments: Mean and variance of the signal at the reference dose.
        geometry: Where the rays are.
        mu_water: Attenuation of water at the effective energy, 1/mm.
        dose_fraction: Dose of this scan over the reference dose, > 0.
        beam_hardening: Correction of the line integrals.
        generator: Generator of the noise, on the device of the moments; None for the noise-free scan of mean
            counts.

    Returns:
        A scan. The noise is drawn with the electronic noise of each bin; the one figure that the scan states
        is its mean over the bins, for q varies across a bow-tie filter (by 8 % either way at 120 kVp).

    Raises:
        ValueError: If `dose_fraction` is not positive, or the moments do not fit the geometry.
    """
    if not (math.isfinite(dose_fraction) and dose_fraction > 0):
        raise ValueError(f"dose_fraction must be positive and finite, got {dose_fraction}.")
    mean, quantum = moments.signal_mean, moments.quantum.to(moments.signal_mean)
    electronic_noise = moments.electronic_noise / quantum
    counts = dose_fraction * mean / quantum
    if generator is not None:
        # Dark rays have no quanta at all; 0/0 would make them NaN.
        size = torch.where(mean > 0, moments.signal_variance / mean, quantum)
        counts = _noisy(dose_fraction * mean / size, size / quantum, electronic_noise, generator)
    return Scan(
        counts=counts,
        incident=dose_fraction * moments.air_mean / moments.quantum,
        electronic_noise=float(electronic_noise.mean()),
        geometry=geometry,
        mu_water=mu_water,
        beam_hardening=beam_hardening,
    )


def _noisy(expected: Rays, size: Tensor, deviation: Tensor, generator: torch.Generator) -> Rays:
    """Draw size · Poisson(expected) + Normal(0, deviation²); sizes and deviations broadcast from the right."""
    if expected.device.type != "cpu" or expected.dtype != torch.float32:
        counts = torch.poisson(expected, generator=generator) * size
        normal = torch.randn(counts.shape, generator=generator, dtype=counts.dtype, device=counts.device)
        return counts + deviation * normal
    # One number of the generator seeds the streams of all rays, so that threads can share the work.
    seed = int(torch.randint(2**62, (), generator=generator))
    sizes = size if size.numel() == 1 else size.expand_as(expected)
    deviations = deviation if deviation.ndim <= 1 else deviation.expand_as(expected)
    counts = torch.empty_like(expected, memory_format=torch.contiguous_format)
    flat = (each.contiguous().view(-1).numpy() for each in (expected, sizes, deviations))
    parallel(draw_counts, expected.numel(), *flat, np.uint64(seed), counts.view(-1).numpy())
    return counts


def _check_counts(counts: Tensor, electronic_noise: float) -> None:
    if broken := int((~counts.isfinite()).sum()):
        raise ValueError(f"Counts must be finite, but {broken} of {counts.numel()} are NaN or infinite.")
    lowest = float(counts.min())
    if lowest < LOWEST_COUNT * electronic_noise:
        raise ValueError(
            f"The lowest count is {lowest:.6g} quanta, too far below 0 for an electronic noise of "
            f"{electronic_noise:.6g} quanta; is the dark signal subtracted twice, or the unit wrong?"
        )
    if float(counts.max()) <= 0:
        raise ValueError("No ray detected anything: no count is above 0.")


def _broadcasts(array: Tensor, shape: tuple[int, ...]) -> bool:
    try:
        return np.broadcast_shapes(array.shape, shape) == shape  # PyTorch's own imports for half a second
    except ValueError:
        return False


def _positive(name: str, array: Tensor) -> None:
    if not bool((array.isfinite() & (array > 0)).all()):
        raise ValueError(
            f"{name} must be positive and finite everywhere; its values go from {float(array.min()):.6g} to "
            f"{float(array.max()):.6g}."
        )


def _not_negative(name: str, number: float) -> None:
    if not 0 <= number <= _LARGEST_NOISE:
        raise ValueError(f"{name} must be finite and not negative, got {number}; at most {_LARGEST_NOISE:g} can be.")
