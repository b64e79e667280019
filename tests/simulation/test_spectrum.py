import math

import numpy as np
import pytest

from pnpct.simulation import Spectrum, tube_spectrum

# Mass energy-absorption coefficients of air, cm²/g, from NIST (Hubbell and Seltzer).
_ENERGIES = [10, 15, 20, 30, 40, 50, 60, 80, 100, 150]
_ABSORPTION = [4.742, 1.334, 0.5389, 0.1537, 0.06833, 0.04098, 0.03041, 0.02407, 0.02325, 0.02496]


def half_value_layer(spectrum: Spectrum) -> float:
    """Aluminium that halves the air kerma, mm."""
    absorption = np.exp(np.interp(np.log(spectrum.energies), np.log(_ENERGIES), np.log(_ABSORPTION)))

    def kerma(thickness: float) -> float:
        return float((spectrum.behind("aluminium", thickness).photons * spectrum.energies * absorption).sum())

    low, high, whole = 0.0, 30.0, kerma(0.0)
    for _ in range(20):
        middle = (low + high) / 2
        low, high = (middle, high) if kerma(middle) > whole / 2 else (low, middle)
    return low


def in_air(tube_voltage_kvp: float, aluminium: float) -> Spectrum:
    return tube_spectrum(tube_voltage_kvp).behind("aluminium", aluminium).behind("air", 1000.0)


def test_mean_energy_and_half_value_layer_are_those_of_spekpy() -> None:
    spectrum = in_air(120.0, 3.0)
    assert spectrum.mean_energy == pytest.approx(56.8, abs=0.4)
    assert half_value_layer(spectrum) == pytest.approx(5.10, abs=0.1)


@pytest.mark.parametrize(
    ("tube_voltage_kvp", "mean_energy", "photons"),
    [(80.0, 48.4, 0.79e6), (100.0, 55.0, 1.42e6), (120.0, 60.6, 2.14e6), (140.0, 65.7, 2.89e6)],
)
def test_means_and_output_are_near_spekpy_at_all_voltages(
    tube_voltage_kvp: float, mean_energy: float, photons: float
) -> None:
    spectrum = in_air(tube_voltage_kvp, 6.0)
    assert spectrum.mean_energy == pytest.approx(mean_energy, abs=0.7)
    # Per mm² and mAs at 1 m.
    assert spectrum.photons.sum() == pytest.approx(photons, rel=0.15)


def test_no_photon_has_more_energy_than_an_electron() -> None:
    spectrum = tube_spectrum(81.3, step=0.5)
    assert (spectrum.photons[spectrum.energies > 81.3] == 0).all()
    assert (spectrum.photons[spectrum.energies < 81.0] > 0).all()


def test_the_k_lines_of_tungsten_appear_above_the_k_edge() -> None:
    for tube_voltage_kvp, factor in ((69.0, 1.0), (120.0, 1.5)):
        spectrum = tube_spectrum(tube_voltage_kvp, step=0.5)
        near = {energy: spectrum.photons[int((energy - 10) / 0.5)] for energy in (57.3, 58.0, 59.3, 60.2)}
        background = (near[57.3] + near[60.2]) / 2
        assert near[59.3] >= factor * background * 0.9
        assert (near[59.3] > 1.2 * background) == (factor > 1)


def test_the_width_of_the_bins_scarcely_matters() -> None:
    fine, coarse = (tube_spectrum(120.0, step=step).behind("aluminium", 6.0) for step in (0.5, 3.0))
    assert coarse.photons.sum() == pytest.approx(fine.photons.sum(), rel=5e-3)
    assert coarse.mean_energy == pytest.approx(fine.mean_energy, abs=0.1)


def test_a_steeper_anode_absorbs_less() -> None:
    shallow, steep = (tube_spectrum(100.0, anode_angle=math.radians(angle)) for angle in (7.0, 15.0))
    assert (steep.photons >= shallow.photons).all()
    assert steep.mean_energy < shallow.mean_energy


def test_filters_multiply() -> None:
    spectrum = tube_spectrum(100.0)
    twice = spectrum.behind("aluminium", 1.0).behind("aluminium", 2.0)
    np.testing.assert_allclose(twice.photons, spectrum.behind("aluminium", 3.0).photons)


def test_impossible_tubes_and_filters_are_refused() -> None:
    with pytest.raises(ValueError, match="40 to 150 kVp"):
        tube_spectrum(120_000.0)
    with pytest.raises(ValueError, match="anode angle"):
        tube_spectrum(120.0, anode_angle=7.0)
    with pytest.raises(ValueError, match="energy bins"):
        tube_spectrum(120.0, step=0.0)
    with pytest.raises(ValueError, match="thickness"):
        tube_spectrum(120.0).behind("aluminium", -1.0)
