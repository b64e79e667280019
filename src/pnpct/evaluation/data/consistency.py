"""Whether an image agrees with the data it was made from: necessary, not sufficient."""

import math
from dataclasses import dataclass
from typing import Literal, TypeAlias

from jaxtyping import Bool
from torch import Tensor

from pnpct.arrays import Image, Rays
from pnpct.evaluation.data.realisations import check_corrected
from pnpct.operators import Projector
from pnpct.physics import Sinogram

OBJECT = 0.2
"""Rays of larger line integrals pass through the object; the others see air, whatever the image."""

CORRELATED = 0.1
"""Correlation of neighbouring residuals that noise of independent rays does not have."""

WEIGHTS = 0.01
"""Relative error of weights from smoothed counts; of ten thousand rays it would be seen."""

Verdict: TypeAlias = Literal["consistent", "data overridden", "residual correlated"]
"""What a residual says of an image."""


@dataclass(frozen=True)
class Consistency:
    """The weighted residual of an image, in figures.

    There are upper limits only. A reconstruction that fits the noise makes chi2 smaller, and neighbouring residuals
    negatively correlated; by how much is not known here.

    Args:
        chi2: Mean of the squared weighted residual; 1 for the truth if weights are inverse variances.
        rays: How many it is the mean of, M.
        along_views: Correlation of the residuals of one bin in neighbouring views, −1 to 1.
        along_bins: Correlation of the residuals of neighbouring bins, −1 to 1.
        floor: chi2 of a trusted image on the same data, by which chi2 is divided.

    Raises:
        ValueError: If `floor` is not positive.
    """

    chi2: float
    rays: int
    along_views: float
    along_bins: float
    floor: float = 1.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.floor) and self.floor > 0):
            raise ValueError(f"The floor is the chi2 of a trusted image, a positive number, got {self.floor}.")

    @property
    def ratio(self) -> float:
        """chi2 / floor, which is tested."""
        return self.chi2 / self.floor

    @property
    def largest_ratio(self) -> float:
        """What noise alone explains: 1, plus 3 standard deviations √(2/M) of the ratio, plus 1 % for the weights.

        Those of `take_log` give the truth 1.003 to 1.006 with 984 views and 900 bins.
        """
        return 1 + 3 * math.sqrt(2 / self.rays) + WEIGHTS

    @property
    def verdict(self) -> Verdict:
        """What it means; "consistent" does not say that every detail is true, see `score_test`."""
        if self.ratio > self.largest_ratio:
            return "data overridden"
        return "residual correlated" if max(self.along_views, self.along_bins) > CORRELATED else "consistent"


def consistency(
    image: Image,
    sinogram: Sinogram,
    projector: Projector,
    *,
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
        floor: chi2 of a trusted image, > 0.

    Returns:
        The figures and the verdict.

    Raises:
        ValueError: If no neighbouring rays see the object, `floor` is not positive, or the rays are not corrected for
            bone yet.

    Example:
        >>> import torch
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
    check_corrected(sinogram)
    residual = sinogram.weights.whiten(sinogram.line_integrals - projector(image)).double()
    seen = _counted(sinogram).expand(residual.shape)
    rays = int(seen.sum())
    squares = float(residual[seen].square().sum())
    return Consistency(
        chi2=squares / max(rays, 1),
        rays=rays,
        along_views=_correlation(residual, seen, dim=-2),
        along_bins=_correlation(residual, seen, dim=-1),
        floor=floor,
    )


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
