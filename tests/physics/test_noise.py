"""The kernel that draws counts: its distributions, and that threads do not matter."""

import math

import numpy as np
import pytest
from scipy import stats

from pnpct.physics.noise_kernels import _normal, draw_counts

COUNT = 200_000


def drawn(mean: float, *, deviation: float = 0.0, seed: int = 1, first: int = 0, last: int = COUNT) -> np.ndarray:
    counts = np.zeros(COUNT, np.float32)
    parts = (np.full(COUNT, mean, np.float32), np.ones(1, np.float32), np.full(1, deviation, np.float32))
    draw_counts(*parts, np.uint64(seed), counts, first, last)
    return counts


@pytest.mark.parametrize("mean", [0.02, 0.7, 6.0, 9.99, 10.0, 47.0, 1000.0])
def test_counts_have_poisson_probabilities(mean: float) -> None:
    counts = drawn(mean)
    np.testing.assert_array_equal(counts, np.round(counts))
    low, high = stats.poisson.ppf([1e-3, 1 - 1e-3], mean)
    edges = np.unique(np.linspace(low, high, 12).round())
    expected = np.diff(stats.poisson.cdf(np.concatenate([[-1.0], edges, [np.inf]]), mean)) * COUNT
    observed = np.histogram(counts, np.concatenate([[-1.0], edges + 0.5, [np.inf]]))[0]
    enough = expected > 5
    chi_square = ((observed - expected)[enough] ** 2 / expected[enough]).sum()
    assert stats.chi2.sf(chi_square, enough.sum() - 1) > 1e-4


def test_large_counts_are_nearly_normal() -> None:
    scores = (drawn(3e5) - 3e5) / math.sqrt(3e5)
    assert stats.kstest(scores, "norm").pvalue > 1e-4


def test_without_a_beam_there_is_electronic_noise_only() -> None:
    assert not drawn(0.0).any()
    noise = drawn(0.0, deviation=3.0)
    assert stats.kstest(noise / 3.0, "norm").pvalue > 1e-4


def test_quantiles_of_the_normal_distribution_are_those_of_scipy() -> None:
    shares = np.concatenate([np.logspace(-16, -1, 60), np.linspace(0.1, 0.9, 41), 1 - np.logspace(-12, -1, 60)])
    np.testing.assert_allclose([_normal(share) for share in shares], stats.norm.ppf(shares), rtol=1e-6, atol=1e-6)


def test_rays_are_independent_and_pieces_make_the_whole() -> None:
    whole = drawn(20.0, deviation=1.0)
    assert abs(np.corrcoef(whole[1:], whole[:-1])[0, 1]) < 0.01
    assert abs(np.corrcoef(whole, drawn(20.0, deviation=1.0, seed=2))[0, 1]) < 0.01
    pieces = drawn(20.0, deviation=1.0, last=777) + drawn(20.0, deviation=1.0, first=777)
    np.testing.assert_array_equal(pieces, whole)
