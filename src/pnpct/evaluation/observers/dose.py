"""How much dose a method saves: the dose at which it finds what the reference finds at full dose."""

import math
from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from typing import Generic, Literal, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from pnpct.evaluation.intervals import Interval

Task = TypeVar("Task", bound=Hashable)

_Array: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True)
class PowerLaw:
    """d′(D) = exp(a + b ln D), fitted to measurements.

    Args:
        intercept: a.
        slope: b; 1/2 where quantum noise alone limits what is seen.
        covariance: Variance of a, covariance, variance of b.
    """

    intercept: float
    slope: float
    covariance: tuple[float, float, float]

    def at(self, dose: float, *, level: float = 0.95) -> Interval:
        """Return d′ at a dose, with the interval of the fit."""
        along = math.log(dose)
        value = math.exp(self.intercept + self.slope * along)
        of_a, of_both, of_b = self.covariance
        error = math.sqrt(of_a + 2 * along * of_both + along**2 * of_b)
        factor = math.exp(float(ndtri((1 + level) / 2)) * error)
        return Interval(value, value / factor, value * factor, standard_error=value * error, level=level)


@dataclass(frozen=True)
class DoseCurve:
    """Detectability of one task by one method, measured at several doses.

    Args:
        doses: Four or more different doses, positive; mA or any other unit, the same everywhere.
        d_primes: d′ at each with its standard error, both positive; measured on scans of their own.

    Raises:
        ValueError: If there are fewer than four different doses, or a number is out of its range.
    """

    doses: tuple[float, ...]
    d_primes: tuple[Interval, ...]

    def __post_init__(self) -> None:
        if len(self.doses) != len(self.d_primes):
            raise ValueError(f"Every dose needs its d′: there are {len(self.doses)} doses, {len(self.d_primes)} d′.")
        if len(set(self.doses)) < 4 or not all(math.isfinite(dose) and dose > 0 for dose in self.doses):
            raise ValueError(f"Detectability against dose needs four different positive doses or more: {self.doses}.")
        for dose, found in zip(self.doses, self.d_primes, strict=True):
            usable = (math.isfinite(value) and value > 0 for value in (found.estimate, found.standard_error))
            if not all(usable):
                raise ValueError(
                    f"d′ and its standard error must be positive at every dose, got {found.estimate:.3g} ± "
                    f"{found.standard_error:.3g} at {dose:g}; take more pairs of images, or leave this dose out."
                )

    def fit(self) -> PowerLaw:
        """Fit ln d′ = a + b ln D by least squares, each point weighted by the inverse variance of its ln d′."""
        solution, _, _ = self._least_squares()
        a, b = solution @ np.log([found.estimate for found in self.d_primes])
        of_a, of_both, _, of_b = (solution @ np.diag(self._errors() ** 2) @ solution.T).ravel().tolist()
        return PowerLaw(float(a), float(b), (of_a, of_both, of_b))

    def draw_fits(self, resamples: int, generator: np.random.Generator) -> _Array:
        """Return a and b of fits to redrawn d′, ln d′ ~ Normal(its estimate, its error²): [resamples, 2]."""
        solution, logarithms, errors = self._least_squares()
        drawn: _Array = generator.normal(logarithms, errors, size=(resamples, logarithms.size)) @ solution.T
        return drawn

    def _errors(self) -> _Array:
        return np.array([found.standard_error / found.estimate for found in self.d_primes])

    def _least_squares(self) -> tuple[_Array, _Array, _Array]:
        """Matrix from all ln d′ to (a, b); ln d′; their errors."""
        errors = self._errors()
        design = np.stack([np.ones(len(self.doses)), np.log(self.doses)], axis=1)
        weighted = design.T / errors**2
        logarithms = np.log([found.estimate for found in self.d_primes])
        return np.linalg.solve(weighted @ design, weighted), logarithms, errors


@dataclass(frozen=True)
class EqualDose:
    """The dose at which a method is as good as the reference at full dose.

    Args:
        dose: It, with its interval. Nothing is read beyond the doses that were measured: an end, or the estimate,
            that is one of `measured` is a bound.
        measured: The lowest and the highest dose that were measured.
        full_dose: The dose of the reference.
        outside: "below" if the method is as good already at the lowest dose, "above" if it is not even at the
            highest; None if the dose was found between.
    """

    dose: Interval
    measured: tuple[float, float]
    full_dose: float
    outside: Literal["below", "above"] | None

    @property
    def fraction(self) -> Interval:
        """The dose over the full dose."""
        full = self.full_dose
        dose = self.dose
        return Interval(dose.estimate / full, dose.low / full, dose.high / full, dose.standard_error / full, dose.level)

    @property
    def reduction(self) -> Interval:
        """1 − fraction; negative if the method needs more dose."""
        part = self.fraction
        return Interval(1 - part.estimate, 1 - part.high, 1 - part.low, part.standard_error, part.level)


@dataclass(frozen=True)
class DoseReduction(Generic[Task]):
    """What a method saves in each task, and what it saves in all of them.

    Args:
        tasks: The result of each task.
        least: The largest of these doses, with an interval for the largest: the claim that holds for every task.
        worst: The task that has it.
    """

    tasks: Mapping[Task, EqualDose]
    least: EqualDose
    worst: Task


def dose_reduction(
    method: Mapping[Task, DoseCurve],
    reference: Mapping[Task, Interval],
    *,
    full_dose: float,
    generator: np.random.Generator,
    resamples: int = 2000,
    level: float = 0.95,
) -> DoseReduction[Task]:
    """Find the dose at which a method reaches the detectability of the reference, in each task and in all.

    With ln d′ = a + b ln D fitted to the method, D_eq = exp((ln d′_reference − a)/b), within the doses that were
    measured. The interval is the parametric bootstrap's: d′ of the method at every dose and d′ of the reference are
    redrawn from their standard errors, as if independent. Where both come from the same scans it is too wide.

    Args:
        method: d′ of the method in each task, all at the same doses, by the Hotelling observer; one that does not
            prewhiten is fooled by blurring.
        reference: d′ of the reference at full dose in the same tasks: FBP with its best kernel, see `best_references`.
        full_dose: Dose of the reference, positive, in the unit of the curves.
        generator: Source of the resamples.
        resamples: At least 2.
        level: Confidence, between 0 and 1.

    Returns:
        The dose of each task, and the largest of them, whose interval is that of the largest: it lies above that of
        each task alone.

    Raises:
        ValueError: If the tasks are not the same or not at the same doses, or a number is out of its range.

    Example:
        >>> doses = (10.0, 20.0, 40.0, 80.0)
        >>> found = tuple(Interval(dose**0.5, 0, 0, standard_error=0.05, level=0.95) for dose in doses)
        >>> curve, random = DoseCurve(doses, found), np.random.default_rng(1)
        >>> result = dose_reduction({"disc": curve}, {"disc": found[-2]}, full_dose=80.0, generator=random)
        >>> round(result.least.reduction.estimate, 6), result.least.outside
        (0.5, None)
    """
    if not method or set(method) != set(reference):
        raise ValueError(f"The method and the reference need the same tasks, got {list(method)} and {list(reference)}.")
    if len({curve.doses for curve in method.values()}) > 1:
        raise ValueError("All tasks must be measured at the same doses; the least reduction has no meaning otherwise.")
    draws = {
        task: _draws(curve, reference[task], full_dose, resamples=resamples, level=level, generator=generator)
        for task, curve in method.items()
    }
    tasks = {task: _result(draws[task], curve, full_dose, level) for task, curve in method.items()}
    worst = max(tasks, key=lambda task: float(draws[task][0]))
    largest = np.max(list(draws.values()), axis=0)
    return DoseReduction(tasks, _result(largest, method[worst], full_dose, level), worst)


def best_references(*kernels: Mapping[Task, DoseCurve], full_dose: float) -> dict[Task, Interval]:
    """Return d′ of the best kernel at full dose in each task, by the fit to all its doses.

    Args:
        kernels: For each kernel of FBP the curves of the same tasks.
        full_dose: A positive dose.

    Raises:
        ValueError: If there is no kernel, or the tasks are not the same.
    """
    if not kernels or len({frozenset(kernel) for kernel in kernels}) > 1:
        raise ValueError("The best kernel is chosen from one kernel or more, each with the same tasks.")
    return {
        task: max((kernel[task].fit().at(full_dose) for kernel in kernels), key=lambda found: found.estimate)
        for task in kernels[0]
    }


def _draws(
    method: DoseCurve,
    reference: Interval,
    full_dose: float,
    *,
    resamples: int,
    level: float,
    generator: np.random.Generator,
) -> _Array:
    """The dose by the estimates, then by each resample; −∞ below the measured doses, ∞ above."""
    if not (math.isfinite(full_dose) and full_dose > 0):
        raise ValueError(f"The full dose must be positive, got {full_dose}.")
    if resamples < 2 or not 0 < level < 1:
        raise ValueError(
            f"A bootstrap needs two resamples or more and a level between 0 and 1, got {resamples} and {level}."
        )
    if not (reference.estimate > 0 and 0 <= reference.standard_error < math.inf):
        raise ValueError(f"The d′ of the reference must be positive, got {reference.estimate:.3g}.")
    law = method.fit()
    a, b = np.concatenate([[[law.intercept, law.slope]], method.draw_fits(resamples, generator)]).T
    error = reference.standard_error / reference.estimate
    goal = math.log(reference.estimate) + error * np.concatenate([[0.0], generator.normal(size=resamples)])
    low, high = math.log(min(method.doses)), math.log(max(method.doses))
    good_at_low, good_at_high = a + b * low >= goal, a + b * high >= goal
    between = ~good_at_low & good_at_high  # there b > 0
    dose = np.exp((goal - a) / np.where(between, b, 1.0), where=between, out=np.full_like(a, math.inf))
    return np.where(good_at_low, -math.inf, dose)


def _result(draws: _Array, method: DoseCurve, full_dose: float, level: float) -> EqualDose:
    measured = min(method.doses), max(method.doses)
    outside: Literal["below", "above"] | None = None
    if not math.isfinite(draws[0]):
        outside = "below" if draws[0] < 0 else "above"
    estimate, *resampled = draws.clip(*measured).tolist()
    low, high = np.quantile(resampled, [(1 - level) / 2, (1 + level) / 2])
    error = float(np.std(resampled, ddof=1))
    dose = Interval(estimate, float(low), float(high), standard_error=error, level=level)
    return EqualDose(dose, measured, full_dose, outside)
