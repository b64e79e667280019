"""From the line integrals of a spectrum to those of one energy, for water."""

import math
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from pnpct.arrays import Rays

LARGEST_LINE_INTEGRAL = 10.0
"""Corrections follow their polynomial from 0 to here (22 000-fold attenuation) and its tangents beyond."""


@dataclass(frozen=True, eq=False)
class BeamHardening:
    """A polynomial per bin that turns measured line integrals y into those at the effective energy, p = h(y).

    The low energies of a spectrum are absorbed first, so that y grows slower than the length of water. Below
    0 and above `LARGEST_LINE_INTEGRAL` the correction continues along the tangent: noise must not reach where
    a polynomial runs away. It knows water only; bone hardens more than it corrects.

    Args:
        coefficients: Highest power first, as for `numpy.polyval`; one row per bin, or one row for all.

    Raises:
        ValueError: If a coefficient is not finite, or h does not rise everywhere from 0 to
            `LARGEST_LINE_INTEGRAL`.

    Example:
        >>> hardening = BeamHardening(torch.tensor([[0.25, 1.0, 0.0]]))  # h(y) = y²/4 + y
        >>> hardening.correct(torch.tensor([[0.0, 2.0]])).tolist()
        [[0.0, 3.0]]
    """

    coefficients: Float[Tensor, "bins powers"]

    def __post_init__(self) -> None:
        if self.coefficients.ndim != 2 or 0 in self.coefficients.shape:
            raise ValueError(
                "A beam-hardening correction needs one row of coefficients per bin, or one for all, got the "
                f"shape {tuple(self.coefficients.shape)}."
            )
        if not bool(self.coefficients.isfinite().all()):
            raise ValueError("A beam-hardening correction needs finite coefficients; some are NaN or infinite.")
        bins = self.coefficients.shape[0]
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
    # numpy, because the libraries behind PyTorch round differently with the place of an array in memory.
    lengths = np.linspace(0.0, longest, 201)[1:]
    share = spectrum.cpu().numpy() / spectrum.sum(-1, keepdim=True).cpu().numpy()
    paths = lengths[:, None] * mu_water.double().cpu().numpy()
    least = paths.min(axis=1, keepdims=True)
    # The least attenuated energy is taken out of the exponent, so that a metre of water does not underflow.
    measured = least[:, 0] - np.log((share[:, None] * np.exp(least - paths)).sum(axis=-1))
    largest = measured[:, -1:]
    powers = np.arange(order, 0, -1)
    orthogonal, triangle = np.linalg.qr((measured / largest)[..., None] ** powers)
    projected = (orthogonal * (mu_effective * lengths)[:, None]).sum(axis=1)
    fitted = np.linalg.solve(triangle, projected[..., None])[..., 0] / largest**powers
    coefficients = np.concatenate([fitted, np.zeros_like(largest)], axis=-1)
    return BeamHardening(torch.from_numpy(coefficients).to(spectrum.device))


def _polynomial(coefficients: Tensor, at: Tensor) -> Tensor:
    """Horner's rule for each bin: in float32 good to 3e-7 of the value."""
    value = torch.zeros_like(at)
    for coefficient in coefficients.unbind(-1):
        value = torch.addcmul(coefficient, value, at)
    return value
