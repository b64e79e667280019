"""From the line integrals of a spectrum to those of one energy, for water and for bone."""

import math
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float
from numpy.typing import NDArray
from torch import Tensor

from pnpct.arrays import Rays
from pnpct.geometry.short_repr import short_repr
from pnpct.physics.bone_hardening import BoneHardening

LARGEST_LINE_INTEGRAL = 10.0
"""Corrections follow their polynomial from 0 to here (22 000-fold attenuation) and its tangents beyond."""


@dataclass(frozen=True, eq=False)
class BeamHardening:
    """A polynomial per bin that turns measured line integrals y into those at the effective energy, p = h(y).

    The low energies of a spectrum are absorbed first, so that y grows slower than the length of water. Below
    0 and above `LARGEST_LINE_INTEGRAL` the correction continues along the tangent: noise must not reach where
    a polynomial runs away. It knows water only; bone hardens more than it corrects, and where bone is only an image
    tells: methods do the rest.

    Args:
        coefficients: Highest power first, as for `numpy.polyval`; one row per bin, or one row for all.
        bone: What line integrals lack behind bone; None where that is not known.

    Raises:
        ValueError: If a coefficient is not finite, h does not rise everywhere from 0 to
            `LARGEST_LINE_INTEGRAL`, or the two corrections are for other bins.

    Example:
        >>> hardening = BeamHardening(torch.tensor([[0.25, 1.0, 0.0]]))  # h(y) = y²/4 + y
        >>> hardening.correct(torch.tensor([[0.0, 2.0]])).tolist()
        [[0.0, 3.0]]
    """

    coefficients: Float[Tensor, "bins powers"]
    bone: BoneHardening | None = None

    __repr__ = short_repr

    def __post_init__(self) -> None:
        if self.coefficients.ndim != 2 or 0 in self.coefficients.shape:
            raise ValueError(
                "A beam-hardening correction needs one row of coefficients per bin, or one for all, got the "
                f"shape {tuple(self.coefficients.shape)}."
            )
        if not bool(self.coefficients.isfinite().all()):
            raise ValueError("A beam-hardening correction needs finite coefficients; some are NaN or infinite.")
        bins = self.coefficients.shape[0]
        if self.bone is not None and self.bone.coefficients.shape[0] not in (1, bins):
            raise ValueError(
                f"The correction for bone is for {self.bone.coefficients.shape[0]} bins, that for water for {bins}."
            )
        stations = torch.linspace(0.0, LARGEST_LINE_INTEGRAL, 101, dtype=torch.float64)
        slopes = self.slope(stations.to(self.coefficients.device)[:, None].expand(101, bins))
        if bool((slopes <= 0).any()):
            station, which = divmod(int(slopes.argmin()), bins)
            raise ValueError(
                f"A beam-hardening correction must rise from 0 to {LARGEST_LINE_INTEGRAL:g}, but that of bin "
                f"{which} has the slope {float(slopes.min()):.3g} at {float(stations[station]):.1f}; fit it "
                "over longer paths, or with fewer powers."
            )

    def correct(self, line_integrals: Rays) -> Rays:
        """Return h(y): line integrals at the effective energy, dimensionless.

        Raises:
            ValueError: If the coefficients are for another number of bins.
        """
        inside = line_integrals.clamp(0.0, LARGEST_LINE_INTEGRAL)
        beyond = self.slope(line_integrals) * (line_integrals - inside)
        return _polynomial(self._for(line_integrals), inside) + beyond

    def slope(self, line_integrals: Rays) -> Rays:
        """Return h′(y), by which the standard deviation of a line integral grows; dimensionless.

        Raises:
            ValueError: If the coefficients are for another number of bins.
        """
        coefficients = self._for(line_integrals)
        powers = torch.arange(coefficients.shape[1] - 1, 0, -1, device=coefficients.device)
        return _polynomial(coefficients[:, :-1] * powers, line_integrals.clamp(0.0, LARGEST_LINE_INTEGRAL))

    def _for(self, line_integrals: Tensor) -> Tensor:
        if self.coefficients.shape[0] not in (1, line_integrals.shape[-1]):
            raise ValueError(
                f"The beam-hardening correction is for {self.coefficients.shape[0]} bins, the line integrals "
                f"have {line_integrals.shape[-1]}."
            )
        return self.coefficients.to(line_integrals)


def fit_water_correction(
    detected_spectrum: Float[Tensor, "bins energies"],
    mu_water: Float[Tensor, "energies"],
    *,
    mu_effective: float,
    order: int = 5,
    longest: float = 500.0,
) -> BeamHardening:
    """Fit the polynomials that make water look as if scanned with one energy.

    Through a length t of water a bin with the detected spectrum s measures

        y(t) = −ln( Σ_E s(E) exp(−μ(E) t) / Σ_E s(E) ),

    and h is the polynomial without constant term that is closest to h(y(t)) = mu_effective · t on even steps
    from 0 to `longest`.

    Args:
        detected_spectrum: What each bin detects of each energy without an object, in any unit, ≥ 0: photons
            after all filters times the detector's response (for an energy-integrating one, energy times
            efficiency).
        mu_water: Attenuation of water at these energies, 1/mm, > 0.
        mu_effective: Attenuation of water at the energy that the image is to show, 1/mm.
        order: Highest power, at least 1.
        longest: Longest path through water that the fit covers, mm.

    Returns:
        The correction, in float64.

    Raises:
        ValueError: If an argument is out of range, a bin detects nothing, or the fit does not rise
            everywhere.

    References:
        Herman, Phys. Med. Biol. 24 (1979) 81.

    Example:
        >>> spectrum, mu_water = torch.ones(1, 2), torch.tensor([0.03, 0.02])
        >>> hardening = fit_water_correction(spectrum, mu_water, mu_effective=0.02)
        >>> measured = -torch.exp(-mu_water * 100.0).mean().log()  # 100 mm of water
        >>> hardening.correct(measured.reshape(1, 1)).item()
        2.00...
    """
    if order < 1:
        raise ValueError(f"The order of a beam-hardening correction is at least 1, got {order}.")
    for name, value in (("mu_effective", mu_effective), ("longest", longest)):
        if not (math.isfinite(value) and value > 0):
            raise ValueError(f"{name} must be positive and finite, got {value}.")
    if not bool((mu_water.isfinite() & (mu_water > 0)).all()):
        raise ValueError("The attenuation of water must be positive and finite at every energy, in 1/mm.")
    spectrum = detected_spectrum.double()
    if not bool((spectrum.isfinite() & (spectrum >= 0)).all() and (spectrum.sum(-1) > 0).all()):
        raise ValueError("A detected spectrum must be finite and not negative, and every bin must detect something.")
    lengths = np.linspace(0.0, longest, 201)[1:]
    measured = _measured(spectrum.cpu().numpy(), lengths[:, None] * mu_water.double().cpu().numpy()).T
    powers = np.arange(order, 0, -1)
    fitted = _least_squares(measured[..., None] ** powers, np.broadcast_to(mu_effective * lengths, measured.shape))
    coefficients = np.concatenate([fitted, np.zeros_like(fitted[:, :1])], axis=-1)
    return BeamHardening(torch.from_numpy(coefficients).to(spectrum.device))


def with_bone(
    water: BeamHardening,
    detected_spectrum: Float[Tensor, "bins energies"],
    mu_water: Float[Tensor, "energies"],
    mu_bone: Float[Tensor, "energies"],
    *,
    mu_effective: tuple[float, float],
    longest: tuple[float, float] = (400.0, 60.0),
) -> BeamHardening:
    """Return a correction for water with one for bone beside it: the polynomials that fit what still lacks.

    Args:
        water: The correction for water.
        detected_spectrum: As for `fit_water_correction`.
        mu_water: Attenuation of water at its energies, 1/mm, > 0.
        mu_bone: Attenuation of compact bone at its energies, 1/mm, > 0.
        mu_effective: Attenuation of water and of compact bone at the energy that the image is to show, 1/mm.
        longest: Longest paths through water and through bone that the fit covers, mm.

    Raises:
        ValueError: If a number is out of range.
    """
    if not all(math.isfinite(number) and number > 0 for number in (*mu_effective, *longest)):
        raise ValueError(f"Attenuations and paths must be positive and finite, got {mu_effective} and {longest}.")
    # numpy, as in the fit for water.
    lengths = np.meshgrid(*(np.linspace(0.0, most, 21) for most in longest), indexing="ij")
    of_water, of_bone = (path.reshape(-1, 1) for path in lengths)
    paths = of_water * mu_water.double().cpu().numpy() + of_bone * mu_bone.double().cpu().numpy()
    measured = _measured(detected_spectrum.double().cpu().numpy(), paths)
    p = water.correct(torch.from_numpy(measured).clone()).numpy()
    q = np.broadcast_to(mu_effective[1] * of_bone, p.shape)
    lacking = mu_effective[0] * of_water + q - p
    powers = np.stack([q, q * p, q * q, q * p * p, q * p * q, q * q * q], axis=-1).swapaxes(0, 1)
    coefficients = torch.from_numpy(_least_squares(powers, lacking.T))
    return replace(water, bone=BoneHardening(coefficients, compact=mu_effective[1] / mu_effective[0]))


def _polynomial(coefficients: Tensor, at: Tensor) -> Tensor:
    """Horner's rule for each bin: in float32 good to 3e-7 of the value."""
    value = torch.zeros_like(at)
    for coefficient in coefficients.unbind(-1):
        value = torch.addcmul(coefficient, value, at)
    return value


def _measured(spectrum: NDArray[np.float64], paths: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what each bin measures, (paths, bins), of a spectrum, (bins, energies), along paths, (paths, energies)."""
    # The least attenuated energy is taken out of the exponent, so that a metre of water does not underflow.
    least = paths.min(axis=1, keepdims=True)
    share = spectrum / spectrum.sum(axis=-1, keepdims=True)
    measured: NDArray[np.float64] = least - np.log((share * np.exp(least - paths)[:, None]).sum(axis=-1))
    return measured


def _least_squares(columns: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the coefficients of columns, (bins, paths, coefficients), for values, (bins, paths)."""
    largest = np.abs(columns).max(axis=1)
    orthogonal, triangle = np.linalg.qr(columns / largest[:, None])
    projected = (orthogonal * values[..., None]).sum(axis=1)
    fitted: NDArray[np.float64] = np.linalg.solve(triangle, projected[..., None])[..., 0] / largest
    return fitted
