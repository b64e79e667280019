"""Our simulator against CatSim, an independent one, on a slice that both see alike."""

import pytest
import torch

from fixtures.make_catsim_mini import LEVELS, VOLTAGES, decode, encode, read_catsim_mini
from pnpct.simulation import scanner_beam, simulate_moments


@pytest.fixture(scope="module")
def mini():
    return read_catsim_mini()


@pytest.mark.parametrize("voltage", VOLTAGES)
def test_air_and_line_integrals_are_those_of_catsim(mini, voltage):
    theirs = mini.moments[voltage]
    beam = scanner_beam(mini.geometry, tube_voltage_kvp=float(voltage))
    ours = simulate_moments(mini.phantom, mini.geometry, [beam])[0]
    torch.testing.assert_close(ours.air_mean.float(), theirs.air_mean, rtol=0.015, atol=0)
    torch.testing.assert_close(ours.quantum.float(), theirs.quantum, rtol=0.006, atol=0)
    measured, expected = (-torch.log(each.signal_mean / each.air_mean).float() for each in (ours, theirs))
    assert expected.max() > 4
    assert (measured - expected).norm() < 0.0025 * expected.norm()
    behind, of_catsim = (each.signal_variance / each.signal_mean for each in (ours, theirs))
    torch.testing.assert_close(behind.float(), of_catsim, rtol=0.008, atol=0)


def test_rounded_fractions_sum_to_1_exactly():
    fractions = torch.rand(7, 20, 20, generator=torch.Generator().manual_seed(0))
    fractions[3] = 0.0
    fractions /= fractions.sum(dim=0)
    levels = encode(fractions)
    assert (levels.sum(axis=0) == LEVELS).all()
    decoded = decode(levels)
    assert torch.equal(decoded.sum(dim=0), torch.ones(20, 20))
    assert (decoded - fractions).abs().max() < 1.001 / LEVELS
    assert not decoded[3].any()
