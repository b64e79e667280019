import math

import numpy as np
import pytest

from pnpct.evaluation import bootstrap


def test_the_standard_error_of_a_mean_is_the_known_one() -> None:
    values = np.random.default_rng(1).normal(size=400)
    interval = bootstrap(np.mean, values, generator=np.random.default_rng(2))
    assert interval.standard_error == pytest.approx(values.std() / math.sqrt(400), rel=0.06)
    assert interval.high - interval.low == pytest.approx(2 * 1.96 * interval.standard_error, rel=0.06)
    assert interval.low < interval.estimate == values.mean() < interval.high


def test_95_percent_intervals_hold_the_truth_about_as_often() -> None:
    generator = np.random.default_rng(3)
    intervals = [bootstrap(np.mean, generator.normal(size=40), generator=generator, resamples=100) for _ in range(120)]
    held = np.mean([interval.low < 0.0 < interval.high for interval in intervals])
    assert 0.87 < held < 0.99


def test_repeated_slices_of_a_patient_add_no_certainty() -> None:
    values = np.random.default_rng(4).normal(size=12)
    alone = bootstrap(np.mean, values, generator=np.random.default_rng(5))
    repeated = bootstrap(
        np.mean, np.repeat(values, 5), cases=np.repeat(np.arange(12), 5).tolist(), generator=np.random.default_rng(5)
    )
    assert repeated.standard_error == pytest.approx(alone.standard_error, rel=1e-9)


def test_samples_are_drawn_together() -> None:
    values = np.arange(1.0, 9.0)
    interval = bootstrap(
        lambda a, b: float(np.mean(a) / np.mean(b)), 3 * values, values, generator=np.random.default_rng(6)
    )
    assert interval.low == pytest.approx(3.0) == interval.high


def test_one_seed_gives_one_interval() -> None:
    first, second = (bootstrap(np.median, [1.0, 5.0, 2.0], generator=np.random.default_rng(7)) for _ in range(2))
    assert first == second


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"cases": ["a", "a", "a"]}, "at least two cases"),
        ({"cases": ["a", "b"]}, "Every row"),
        ({"resamples": 1}, "two resamples"),
        ({"level": 1.0}, "two resamples"),
    ],
)
def test_what_cannot_be_resampled_is_refused(options: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        bootstrap(np.mean, [1.0, 2.0, 3.0], generator=np.random.default_rng(8), **options)


def test_samples_of_different_length_are_refused() -> None:
    with pytest.raises(ValueError, match="one length"):
        bootstrap(max, [1.0, 2.0], [1.0], generator=np.random.default_rng(8))
