"""How sure a number is: bootstrap confidence intervals over cases."""

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Interval:
    """A number with its confidence interval.

    Args:
        estimate: The number from all cases.
        low: Lower end of the interval.
        high: Upper end of the interval.
        standard_error: Standard deviation of the number over the resamples.
        level: Confidence of the interval, between 0 and 1.
    """

    estimate: float
    low: float
    high: float
    standard_error: float
    level: float


def bootstrap(
    statistic: Callable[..., float],
    *samples: Sequence[float] | NDArray[np.float64],
    generator: np.random.Generator,
    cases: Sequence[Hashable] | None = None,
    resamples: int = 2000,
    level: float = 0.95,
) -> Interval:
    """Estimate a statistic with its percentile bootstrap interval over cases.

    Cases are drawn with replacement, each with all its rows in all samples, and the statistic is computed anew
    each time; the ends of the interval are the (1 ∓ level)/2 quantiles. Slices of one patient are not
    independent: name the patient of each row in `cases`, or the interval is too narrow.

    Args:
        statistic: From the samples, in their order, to a number.
        samples: One value or more for each row, drawn together; all of one length.
        generator: Source of the resamples.
        cases: The case (patient) of each row; every row is its own case if None. At least two cases.
        resamples: How often cases are drawn, at least 2.
        level: Confidence, between 0 and 1.

    Returns:
        The statistic of all rows and its interval, in the unit of the statistic.

    Raises:
        ValueError: If the samples have different lengths, there are fewer than two cases, or a number is out
            of its range.

    References:
        Efron and Tibshirani, An Introduction to the Bootstrap (1993), section 13.3.

    Example:
        >>> interval = bootstrap(np.mean, [1.0, 2.0, 3.0], generator=np.random.default_rng(1))
        >>> interval.estimate, interval.low >= 1.0, interval.high <= 3.0
        (2.0, True, True)
    """
    arrays = [np.asarray(sample, dtype=np.float64) for sample in samples]
    rows_of_case = _rows_of_cases(arrays, cases)
    if len(rows_of_case) < 2:
        raise ValueError(f"A bootstrap needs at least two cases, got {len(rows_of_case)}.")
    if resamples < 2 or not 0 < level < 1:
        raise ValueError(
            f"A bootstrap needs two resamples or more and a level between 0 and 1, got {resamples} and {level}."
        )
    values = np.empty(resamples)
    for index in range(resamples):
        drawn = generator.integers(len(rows_of_case), size=len(rows_of_case))
        rows = np.concatenate([rows_of_case[case] for case in drawn])
        values[index] = float(statistic(*(array[rows] for array in arrays)))
    low, high = np.quantile(values, [(1 - level) / 2, (1 + level) / 2])
    estimate = float(statistic(*arrays))
    return Interval(estimate, float(low), float(high), standard_error=float(values.std(ddof=1)), level=level)


def _rows_of_cases(arrays: list[NDArray[np.float64]], cases: Sequence[Hashable] | None) -> list[NDArray[np.int64]]:
    lengths = {array.shape[0] if array.ndim else 0 for array in arrays}
    if len(lengths) != 1:
        raise ValueError(f"A bootstrap needs samples of one length, got the lengths {sorted(lengths)}.")
    (length,) = lengths
    if cases is None:
        return [np.array([row], dtype=np.int64) for row in range(length)]
    if len(cases) != length:
        raise ValueError(f"Every row needs its case: there are {length} rows, got {len(cases)} cases.")
    rows: dict[Hashable, list[int]] = {}
    for row, case in enumerate(cases):
        rows.setdefault(case, []).append(row)
    return [np.array(of_case, dtype=np.int64) for of_case in rows.values()]
