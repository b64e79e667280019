"""Whether an image agrees with the data it was made from: necessary, not sufficient."""

import math
from dataclasses import dataclass
from typing import Literal, TypeAlias

import torch
from jaxtyping import Bool
from torch import Tensor

from pnpct.arrays import Image, Rays
from pnpct.evaluation.data.realisations import Reconstruct, ray_weights
from pnpct.operators import Projector
from pnpct.physics import Sinogram

OBJECT = 0.2
"""Rays of larger line integrals pass through the object; the others see air, whatever the image."""

CORRELATED = 0.1
"""Correlation of neighbouring residuals that noise of independent rays does not have."""

WEIGHTS = 0.01
"""Relative error of weights from smoothed counts; of ten thousand rays it would be seen."""

Verdict: TypeAlias = Literal["consistent", "data overridden", "noise fitted", "residual correlated"]
"""What a residual says of an image."""


@dataclass(frozen=True)
class Consistency:
    """The weighted residual of an image, in figures.

    Args:
        chi2: Mean of the squared weighted residual; 1 for the truth if weights are inverse variances.
        rays: How many it is the mean of, M.
        along_views: Correlation of the residuals of one bin in neighbouring views, −1 to 1.
        along_bins: Correlation of the residuals of neighbouring bins, −1 to 1.
        fitted: Degrees of freedom that the reconstruction has taken out of the noise, see `fitted_degrees`; None if
            unknown: then only upper ends are tested, and fitted noise is not noticed.
        floor: chi2 of a trusted image on the same data, by which chi2 is divided.

    Raises:
        ValueError: If `floor` is not positive, or `fitted` is not a number of degrees below that of rays.
    """

    chi2: float
    rays: int
    along_views: float
    along_bins: float
    fitted: float | None = None
    floor: float = 1.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.floor) and self.floor > 0):
            raise ValueError(f"The floor is the chi2 of a trusted image, a positive number, got {self.floor}.")
        if self.fitted is not None and not self.fitted < self.rays:
            raise ValueError(
                f"Of {self.rays} rays fewer degrees of freedom can be fitted, got {self.fitted}; were they estimated "
                "on other rays?"
            )

    @property
    def ratio(self) -> float:
        """chi2 / floor, which is tested."""
        return self.chi2 / self.floor

    @property
    def standard_error(self) -> float:
        """Standard deviation of the ratio for independent Gaussian noise, √(2/M)."""
        return math.sqrt(2 / self.rays)

    @property
    def band(self) -> tuple[float, float]:
        """Between what the ratio must be: from 1 − fitted/M to 1, by 3 standard errors and 1 % wider on either side.

        The 1 % is for the weights: those of `take_log` give the truth 1.003 to 1.006 with 984 views and 900 bins.
        """
        margin = 3 * self.standard_error + WEIGHTS
        low = 0.0 if self.fitted is None else 1 - self.fitted / self.rays - margin
        return low, 1 + margin

    @property
    def correlation_band(self) -> tuple[float, float]:
        """Between what both correlations must be.

        Structure that the image lacks makes them positive. A fit of the noise makes them negative, by at most f/(1 − f)
        for a linear reconstruction that takes out a share f of it.
        """
        if self.fitted is None:
            return -1.0, CORRELATED
        share = max(self.fitted, 0.0) / self.rays
        return max(-1.0, -CORRELATED - share / (1 - share)), CORRELATED

    @property
    def verdict(self) -> Verdict:
        """What it means; "consistent" does not say that every detail is true, see `score_test`."""
        low, high = self.band
        if self.ratio > high:
            return "data overridden"
        if self.ratio < low:
            return "noise fitted"
        least, most = self.correlation_band
        if any(not least <= value <= most for value in (self.along_views, self.along_bins)):
            return "residual correlated"
        return "consistent"


def consistency(
    image: Image,
    sinogram: Sinogram,
    projector: Projector,
    *,
    fitted: float | None = None,
    floor: float = 1.0,
) -> Consistency:
    """Compare the projection of an image with the data.

        chi2 = Σ r² / M,     r = √W (y − A x) of the M rays with y > 0.2

    Clearly above 1 the prior has overridden the data. A lesion that was invented or removed changes chi2 by next to
    nothing: look for it with `score_test`. Judge the image that is shipped, not another iterate.

    Weights must be inverse variances for chi2 itself to mean something. `take_log` has them for a beam of one energy
    and a fine scan; with 180 views the smoothing of counts across edges gives the truth 1.05. Hardened quanta are up to
    a fifth larger, and beam hardening and coarse pixels leave residuals that no image takes away: the truth of a chest
    has 1.16 at 40 mA and 1.75 at 400 mA. Then, and where weights are known up to a factor only, hand the chi2 of a
    trusted image on the same data (the truth, or FBP of the same object at full dose) as `floor`: the factor drops out
    of the ratio.

    Args:
        image: Attenuation relative to water; all views of the sinogram are compared with it.
        sinogram: The data; rays of weight 0 do not count.
        projector: A.
        fitted: Degrees of freedom of the reconstruction, from `fitted_degrees`.
        floor: chi2 of a trusted image, > 0.

    Returns:
        The figures and the verdict.

    Raises:
        ValueError: If no neighbouring rays see the object, `floor` is not positive or `fitted` is too large.

    Example:
        >>> from pnpct.geometry import FanBeam, ImageGrid, evenly_spaced_views
        >>> from pnpct.physics import DiagonalWeights
        >>> geometry = FanBeam(evenly_spaced_views(8), bins=9, source_to_isocenter=500.0, source_to_detector=1000.0,
        ...                    bin_width=20.0)
        >>> projector = Projector(ImageGrid(32, 32, spacing=4.0), geometry)
        >>> image = torch.ones(32, 32)
        >>> data = Sinogram(projector(image) + 0.1, DiagonalWeights(torch.full((8, 9), 100.0)))
        >>> consistency(image, data, projector).verdict  # all residuals are one standard deviation, and alike
        'residual correlated'
    """
    residual = sinogram.weights.whiten(sinogram.line_integrals - projector(image)).double()
    seen = _counted(sinogram).expand(residual.shape)
    rays = int(seen.sum())
    squares = float(residual[seen].square().sum())
    return Consistency(
        chi2=squares / max(rays, 1),
        rays=rays,
        along_views=_correlation(residual, seen, dim=-2),
        along_bins=_correlation(residual, seen, dim=-1),
        fitted=fitted,
        floor=floor,
    )


def fitted_degrees(
    reconstruct: Reconstruct,
    sinogram: Sinogram,
    projector: Projector,
    *,
    generator: torch.Generator,
    probes: int = 1,
    step: float = 0.1,
) -> float:
    """Estimate how much of the noise a reconstruction takes out of its residual, with random probes.

    For v of random signs and J = √W A (∂x/∂y) √W⁻¹, by finite differences,

        fitted = E[‖v‖² − ‖v − J v‖²] = tr(2J − JᵀJ)     so that     E chi2 = 1 − fitted/M

    for a linear reconstruction without bias. It is tr J, as is often written, only where J is a projection.

    Args:
        reconstruct: The reconstruction; give it a fixed number of iterations, for a rule that stops earlier or later
            by a hair is no derivative.
        sinogram: The data; noise is moved in all rays and counted in those of `consistency`.
        projector: A.
        generator: Source of the signs, on the device of the data.
        probes: How many, at least 1; each costs a reconstruction, and a thousand fitted degrees are known to a few
            per cent by one.
        step: How far the data are moved, in standard deviations, > 0.

    Returns:
        Degrees of freedom, to be handed to `consistency`.

    Raises:
        ValueError: If `probes` or `step` is out of its range, or the noise of the rays is correlated.

    References:
        Hutchinson, Commun. Stat. Simul. Comput. 19 (1990) 433; Ramani, Blu and Unser, IEEE Trans. Image Process. 17
        (2008) 1540: the same for any denoiser. Hastie and Tibshirani, Generalized Additive Models (1990), section 3.5:
        degrees of freedom for the residual.
    """
    if probes < 1 or not (math.isfinite(step) and step > 0):
        raise ValueError(f"At least one probe and a positive step are needed, got {probes} and {step}.")
    y, weights = sinogram.line_integrals, ray_weights(sinogram)
    seen = _counted(sinogram).expand(y.shape)
    inverse = torch.where(weights > 0, weights, torch.inf).rsqrt()
    before = projector(reconstruct(sinogram))
    total = 0.0
    for _ in range(probes):
        signs = torch.randint(2, y.shape, generator=generator, device=y.device).to(y) * 2 - 1
        moved = projector(reconstruct(Sinogram(y + step * inverse * signs, sinogram.weights)))
        left = signs - weights.sqrt() * (moved - before) / step
        total += float((1 - left[seen].double().square()).sum())
    return total / probes


def _counted(sinogram: Sinogram) -> Bool[Tensor, "*batch views bins"]:
    return (sinogram.line_integrals > OBJECT) & (sinogram.weights.diagonal > 0)


def _correlation(residual: Rays, seen: Bool[Tensor, "*batch views bins"], *, dim: int) -> float:
    """Mean product of neighbours over the mean square of the same rays; no mean is taken off, for noise has none."""
    length = residual.shape[dim] - 1
    first, second = residual.narrow(dim, 0, length), residual.narrow(dim, 1, length)
    both = seen.narrow(dim, 0, length) & seen.narrow(dim, 1, length)
    squares = float((first.square() + second.square())[both].sum()) / 2
    if not bool(both.any()):
        raise ValueError(
            f"Consistency needs neighbouring rays that see the object: line integrals above {OBJECT} in two views and "
            "two bins or more, got none."
        )
    return float((first * second)[both].sum()) / squares if squares > 0 else 0.0
