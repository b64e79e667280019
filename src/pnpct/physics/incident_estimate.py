"""How many quanta a scan had, by the noise of its line integrals."""

import math

import numpy as np
from numpy.typing import NDArray

MOST_QUANTA = 1e7
"""More than any detector counts in a ray, and the estimate where no noise can be seen."""

_MEDIAN_OF_CHI_SQUARE = 0.4549364


def estimate_incident(line_integrals: NDArray[np.float64]) -> float:
    """Estimate the incident quanta of line integrals p from their noise.

    The variance of p = −ln(counts/incident) is exp(p)/incident, that of the second difference along the detector six
    times as much. The median over all rays of its square, over 6 exp(p), is 0.455/incident: edges of the object do
    not move a median. Line integrals that somebody has smoothed seem to have more quanta than they had; electronic
    noise counts as if it were that of quanta.

    Args:
        line_integrals: p, (..., views, bins), NaN where not measured.

    Returns:
        Quanta per ray without object, 1 to 1e7.

    Example:
        >>> counts = np.random.default_rng(0).poisson(1e4 * np.exp(-2.0), (100, 200))
        >>> round(estimate_incident(-np.log(counts / 1e4)), -3)
        10000.0
    """
    p = line_integrals
    if p.shape[-1] < 3:
        return MOST_QUANTA
    second = p[..., :-2] - 2 * p[..., 1:-1] + p[..., 2:]
    scaled = np.square(second) * np.exp(-p[..., 1:-1]) / 6
    scaled = scaled[np.isfinite(scaled)]
    spread = float(np.median(scaled)) if scaled.size else math.inf
    return min(max(_MEDIAN_OF_CHI_SQUARE / max(spread, 1e-30), 1.0), MOST_QUANTA)
