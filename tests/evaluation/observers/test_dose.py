import math

import numpy as np
import pytest

from pnpct.evaluation import (
    DoseCurve,
    Interval,
    best_references,
    dose_reduction,
)

DOSES = (25.0, 50.0, 100.0, 200.0, 400.0)


def measured(value: float, error: float) -> Interval:
    return Interval(value, value - 1.96 * error, value + 1.96 * error, standard_error=error, level=0.95)


def curve(
    at_full: float,
    *,
    slope: float = 0.5,
    error: float = 0.05,
    doses: tuple[float, ...] = DOSES,
    seed: int | None = None,
) -> DoseCurve:
    """d′ with relative errors around a power law that has a value at 200 mA."""
    noise = np.zeros(len(doses)) if seed is None else np.random.default_rng(seed).normal(scale=error, size=len(doses))
    values = [at_full * (dose / 200) ** slope * math.exp(each) for dose, each in zip(doses, noise, strict=True)]
    return DoseCurve(doses, tuple(measured(value, error * value) for value in values))


def equal(method: DoseCurve, reference: Interval, **options):
    defaults = {"full_dose": 200.0, "generator": np.random.default_rng(1), "resamples": 500}
    return dose_reduction({"disc": method}, {"disc": reference}, **{**defaults, **options}).tasks["disc"]


def test_a_power_law_is_found_again() -> None:
    law = curve(3.0, slope=0.4).fit()
    assert law.slope == pytest.approx(0.4)
    assert law.at(77.0).estimate == pytest.approx(3.0 * (77 / 200) ** 0.4)


def test_the_errors_of_the_fit_are_its_spread_over_repeated_studies() -> None:
    laws = [curve(3.0, seed=seed).fit() for seed in range(300)]
    assert np.std([law.slope for law in laws]) == pytest.approx(laws[0].covariance[2] ** 0.5, rel=0.15)
    values = [law.at(350.0).estimate for law in laws]
    assert np.std(values) == pytest.approx(laws[0].at(350.0).standard_error, rel=0.15)
    draws = curve(3.0).draw_fits(4000, np.random.default_rng(2))
    of_a, of_both, of_b = laws[0].covariance
    assert np.cov(draws.T) == pytest.approx(np.array([[of_a, of_both], [of_both, of_b]]), rel=0.1)


def test_an_uncertain_point_counts_for_less() -> None:
    sure = curve(3.0)
    wild = DoseCurve(sure.doses, (measured(9.0, 5.0), *sure.d_primes[1:]))
    wrong = DoseCurve(sure.doses, (measured(9.0, 0.45), *sure.d_primes[1:]))
    assert abs(wild.fit().slope - 0.5) < abs(wrong.fit().slope - 0.5) / 20


@pytest.mark.parametrize(("gain", "slope"), [(1.0, 0.5), (1.3, 0.5), (0.8, 0.5), (1.3, 0.4)])
def test_a_method_that_finds_more_needs_the_dose_of_the_formula(gain: float, slope: float) -> None:
    found = equal(curve(3.0 * gain, slope=slope), measured(3.0, 0.1))
    assert found.outside is None
    assert found.fraction.estimate == pytest.approx(gain ** (-1 / slope))
    assert found.reduction.estimate == pytest.approx(1 - gain ** (-1 / slope))
    assert found.dose.low < found.dose.estimate < found.dose.high
    assert found.reduction.low == pytest.approx(1 - found.fraction.high)


def test_both_uncertainties_make_the_interval() -> None:
    law = curve(3.0).fit().at(200.0)
    alone, with_reference = (
        equal(curve(3.0), measured(3.0, error), resamples=4000).fraction for error in (1e-9, 3 * 0.05)
    )
    # δ ln D = δ ln d′ / b.
    of_fit = law.standard_error / law.estimate / 0.5
    assert alone.standard_error == pytest.approx(of_fit, rel=0.1)
    assert with_reference.standard_error == pytest.approx(math.hypot(of_fit, 0.05 / 0.5), rel=0.1)


def test_the_interval_holds_the_true_dose_as_often_as_it_says() -> None:
    held = 0
    for seed in range(200):
        reference = 3.0 * math.exp(np.random.default_rng(1000 + seed).normal(scale=0.04))
        found = equal(curve(3.6, seed=seed), measured(reference, 0.04 * reference), resamples=300)
        held += found.fraction.low <= 1.2**-2 <= found.fraction.high
    assert 182 <= held <= 198


@pytest.mark.parametrize(("gain", "outside", "bound"), [(4.0, "below", 25.0), (0.5, "above", 400.0)])
def test_nothing_is_read_beyond_the_measured_doses(gain: float, outside: str, bound: float) -> None:
    found = equal(curve(3.0 * gain), measured(3.0, 0.1))
    assert found.outside == outside
    assert found.dose.estimate == bound
    assert found.measured == (25.0, 400.0)
    assert bound in (found.dose.low, found.dose.high)
    assert 25.0 <= found.dose.low <= found.dose.high <= 400.0


def test_a_method_that_dose_does_not_help_is_outside() -> None:
    assert equal(curve(2.0, slope=-0.1), measured(3.0, 0.1)).outside == "above"
    assert equal(curve(4.5, slope=0.0), measured(3.0, 0.1)).outside == "below"


def test_the_least_reduction_is_that_of_the_worst_task() -> None:
    methods = {"large": curve(6.0), "small": curve(3.0 * 1.1)}
    references = {"large": measured(3.0, 0.1), "small": measured(3.0, 0.1)}
    found = dose_reduction(methods, references, full_dose=200.0, generator=np.random.default_rng(1), resamples=500)
    assert found.worst == "small"
    assert found.least.reduction.estimate == found.tasks["small"].reduction.estimate
    assert found.tasks["large"].fraction.estimate == pytest.approx(0.25)


def test_the_least_of_equal_tasks_is_below_each_of_them() -> None:
    tasks = range(6)
    methods, references = {task: curve(3.0) for task in tasks}, {task: measured(3.0, 0.1) for task in tasks}
    found = dose_reduction(methods, references, full_dose=200.0, generator=np.random.default_rng(1), resamples=1000)
    assert found.least.reduction.low < min(task.reduction.low for task in found.tasks.values()) + 0.02
    assert found.least.reduction.high < min(task.reduction.high for task in found.tasks.values())


def test_the_reference_is_the_best_kernel_of_each_task() -> None:
    sharp, smooth = {"small": curve(3.0), "large": curve(2.0)}, {"small": curve(2.5), "large": curve(2.2)}
    best = best_references(sharp, smooth, full_dose=200.0)
    assert {task: found.estimate for task, found in best.items()} == pytest.approx({"small": 3.0, "large": 2.2})
    assert best["small"] == sharp["small"].fit().at(200.0)


def test_one_seed_gives_one_result() -> None:
    assert equal(curve(3.3), measured(3.0, 0.1)) == equal(curve(3.3), measured(3.0, 0.1))


def test_what_cannot_be_fitted_is_refused() -> None:
    good = curve(3.0)
    with pytest.raises(ValueError, match="four different positive doses"):
        DoseCurve((1.0, 2.0, 2.0, 3.0), good.d_primes[:4])
    with pytest.raises(ValueError, match="four different positive doses"):
        DoseCurve((0.0, 1.0, 2.0, 3.0), good.d_primes[:4])
    with pytest.raises(ValueError, match="5 doses, 4 d′"):
        DoseCurve(DOSES, good.d_primes[:4])
    with pytest.raises(ValueError, match=r"got -0\.1 ± 0\.2 at 400; take more pairs"):
        DoseCurve(DOSES, (*good.d_primes[:4], measured(-0.1, 0.2)))
    with pytest.raises(ValueError, match="reference must be positive"):
        equal(good, measured(-1.0, 0.1))
    with pytest.raises(ValueError, match="two resamples"):
        equal(good, measured(3.0, 0.1), resamples=1)
    with pytest.raises(ValueError, match="full dose must be positive"):
        equal(good, measured(3.0, 0.1), full_dose=0.0)
    with pytest.raises(ValueError, match="same tasks"):
        dose_reduction({"a": good}, {"b": measured(3, 0.1)}, full_dose=1.0, generator=np.random.default_rng(1))
    with pytest.raises(ValueError, match="same doses"):
        dose_reduction(
            {"a": good, "b": curve(3.0, doses=(1.0, 2.0, 3.0, 4.0))},
            {"a": measured(3, 0.1), "b": measured(3, 0.1)},
            full_dose=1.0, generator=np.random.default_rng(1),
        )  # fmt: skip
    with pytest.raises(ValueError, match="same tasks"):
        best_references({"a": good}, {"b": good}, full_dose=1.0)
