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


@pytest.mark.parametrize(("tube_voltage_kvp", "hvl"), [(80.0, 4.9), (100.0, 6.1), (120.0, 7.3), (140.0, 8.3)])
def test_half_value_layers_behind_3_mm_of_aluminium_are_those_of_clinical_beams(
    tube_voltage_kvp: float, hvl: float
) -> None:
    assert half_value_layer(tube_spectrum(tube_voltage_kvp).behind("aluminium", 3.0)) == pytest.approx(hvl, abs=0.5)


def test_no_photon_has_more_energy_than_an_electron() -> None:
    assert tube_spectrum(80.0).energies.max() < 80.0
    assert tube_spectrum(120.0, bins=20).energies.max() < 120.0


def test_the_k_lines_of_tungsten_appear_above_the_k_edge() -> None:
    spectrum = tube_spectrum(120.0)
    at = {energy: spectrum.photons[np.argmin(abs(spectrum.energies - energy))] for energy in (56.5, 59.5, 61.5)}
    assert at[59.5] > 1.5 * (at[56.5] + at[61.5]) / 2


@pytest.mark.parametrize("bins", [10, 20, 60])
def test_sorting_into_bins_keeps_photons_and_energy(bins: int) -> None:
    fine, coarse = tube_spectrum(100.0), tube_spectrum(100.0, bins=bins)
    assert len(coarse.energies) <= bins
    assert coarse.photons.sum() == pytest.approx(fine.photons.sum())
    assert coarse.mean_energy == pytest.approx(fine.mean_energy)


def test_between_two_tables_is_their_mixture() -> None:
    low, middle, high = (tube_spectrum(voltage).photons for voltage in (100.0, 105.0, 110.0))
    shared = len(low)
    np.testing.assert_allclose(middle[:shared], (low + high[:shared]) / 2)


def test_filters_multiply() -> None:
    spectrum = tube_spectrum(100.0)
    twice = spectrum.behind("aluminium", 1.0).behind("aluminium", 2.0)
    np.testing.assert_allclose(twice.photons, spectrum.behind("aluminium", 3.0).photons)


def test_impossible_tubes_and_filters_are_refused() -> None:
    with pytest.raises(ValueError, match="70 to 140 kVp"):
        tube_spectrum(120_000.0)
    with pytest.raises(ValueError, match="at least 8 bins"):
        tube_spectrum(120.0, bins=2)
    with pytest.raises(ValueError, match="thickness"):
        tube_spectrum(120.0).behind("aluminium", -1.0)
