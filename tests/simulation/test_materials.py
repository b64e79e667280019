import numpy as np
import pytest

from pnpct.simulation import MATERIALS, Material, attenuation
from pnpct.units import MU_WATER_70_KEV


def test_water_and_bone_attenuate_as_nist_says() -> None:
    # NIST XCOM / Hubbell and Seltzer, 1/cm.
    energies = np.array([60.0, 80.0, 100.0])
    np.testing.assert_allclose(attenuation("water", energies) * 10, [0.2059, 0.1837, 0.1707], rtol=2e-3)
    np.testing.assert_allclose(attenuation("cortical bone", energies[:1]) * 10, [0.604], rtol=5e-3)
    assert attenuation("water", np.array([70.0])).item() == pytest.approx(MU_WATER_70_KEV, rel=2e-3)


@pytest.mark.parametrize(
    ("material", "low", "high"),
    [
        ("air", -1000, -998),
        ("lung", -760, -720),
        ("adipose", -110, -60),
        ("muscle", 30, 60),
        ("blood", 40, 70),
        ("iodinated blood", 250, 400),
        ("cortical bone", 1400, 1700),
    ],
)
def test_tissues_have_their_hounsfield_units_at_70_kev(material: str, low: float, high: float) -> None:
    water = attenuation("water", np.array([70.0])).item()
    hu = 1000 * (attenuation(material, np.array([70.0])).item() / water - 1)
    assert low < hu < high


def test_attenuation_falls_with_energy_away_from_edges() -> None:
    energies = np.arange(52.0, 140.0)
    for material in set(MATERIALS) - {"tungsten"}:
        assert (np.diff(attenuation(material, energies)) < 0).all(), material


def test_iodine_and_gadolinium_jump_at_their_k_edges() -> None:
    below, above = attenuation("iodinated blood", np.array([33.0, 33.4]))
    assert above > 1.2 * below
    below, above = attenuation("scintillator", np.array([50.0, 50.5]))
    assert above > 2 * below


def test_what_is_unknown_or_off_the_tables_is_refused() -> None:
    with pytest.raises(ValueError, match='no material "butter"; there are air, water'):
        attenuation("butter", np.array([70.0]))
    for energy in (0.5, 70_000.0, np.nan):
        with pytest.raises(ValueError, match="1 to 1000 keV"):
            attenuation("water", np.array([energy]))


def test_impossible_materials_are_refused() -> None:
    with pytest.raises(ValueError, match="density"):
        Material(0.0, {"H": 1.0})
    with pytest.raises(ValueError, match=r"sum to 1, got 0\.9000"):
        Material(1.0, {"H": 0.1, "O": 0.8})
