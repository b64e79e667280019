import numpy as np
import pytest
import torch

from pnpct.evaluation import body_mask
from pnpct.geometry import ImageGrid
from pnpct.simulation import Phantom, abdomen_body, truth
from pnpct.simulation.anatomy.painted_body import PaintedBody
from pnpct.units import to_hu

GRID = ImageGrid(180, 180, spacing=2.5)
KIDNEYS, LIVER, DIAPHRAGM = -10.0, 50.0, 95.0


@pytest.fixture(scope="module")
def patient() -> PaintedBody:
    """A patient in the portal venous phase."""
    return abdomen_body(np.random.default_rng(6))


@pytest.fixture(scope="module")
def other() -> PaintedBody:
    """A patient without contrast medium."""
    return abdomen_body(np.random.default_rng(1))


def hu_where(phantom: Phantom, material: str, share: float = 0.55) -> torch.Tensor:
    return to_hu(truth(phantom, GRID))[phantom.fractions[phantom.materials.index(material)] > share]


def middle_of(phantom: Phantom, material: str, share: float = 0.3) -> tuple[float, float]:
    y, x = np.nonzero(phantom.fractions[phantom.materials.index(material)].numpy() > share)
    return float(GRID.x[x].mean()), float(GRID.y[y].mean())


def test_one_seed_is_one_patient_and_another_seed_another(patient: PaintedBody, other: PaintedBody) -> None:
    here = patient.slice(0.0, GRID)
    again = abdomen_body(np.random.default_rng(6)).slice(0.0, GRID)
    assert again.materials == here.materials
    assert again.fractions.numpy().tobytes() == here.fractions.numpy().tobytes()
    assert (truth(other.slice(0.0, GRID), GRID) - truth(here, GRID)).abs().mean() > 0.01


def test_one_seed_is_one_patient_on_every_grid(patient: PaintedBody) -> None:
    fine = patient.slice(KIDNEYS, ImageGrid(360, 360, spacing=1.25))
    difference = truth(fine, GRID) - truth(patient.slice(KIDNEYS, GRID), GRID)
    assert difference.abs().mean() < 0.01
    assert difference.mean().abs() < 0.003


@pytest.mark.parametrize("share", [0.0, 0.2, 0.4, 0.6, 0.8, 1.0])
def test_every_height_is_a_human_slice(patient: PaintedBody, share: float) -> None:
    lowest, highest = patient.extent
    phantom = patient.slice(lowest + share * (highest - lowest), GRID)
    assert phantom.fractions.min() >= 0
    torch.testing.assert_close(phantom.fractions.sum(0), torch.ones(GRID.shape))
    y, x = np.nonzero(body_mask(truth(phantom, GRID)).numpy())
    assert 310 < (np.ptp(x) + 1) * 2.5 < 440
    assert 220 < (np.ptp(y) + 1) * 2.5 < 360
    assert np.hypot(GRID.x[x], GRID.y[y]).max() < 225


def test_outside_the_extent_nothing_is_known(patient: PaintedBody) -> None:
    with pytest.raises(ValueError, match="reaches from"):
        patient.slice(patient.extent[1] + 1, GRID)


def test_neighbouring_slices_are_alike(patient: PaintedBody) -> None:
    here, beside, away = (truth(patient.slice(z, GRID), GRID) for z in (20.0, 20.6, 60.0))
    assert (beside - here).abs().mean() < 0.2 * (away - here).abs().mean()


def test_organs_have_their_hounsfield_units_in_the_portal_venous_phase(patient: PaintedBody) -> None:
    kidneys, liver = patient.slice(KIDNEYS, GRID), patient.slice(LIVER, GRID)
    assert hu_where(liver, "liver").median().item() == pytest.approx(100, abs=20)
    assert hu_where(liver, "spleen").median().item() == pytest.approx(120, abs=20)
    assert hu_where(kidneys, "kidney", 0.45).median().item() == pytest.approx(155, abs=25)
    assert hu_where(kidneys, "muscle", 0.8).median().item() == pytest.approx(38, abs=10)
    assert hu_where(kidneys, "adipose", 0.8).median().item() == pytest.approx(-72, abs=10)
    hu = to_hu(truth(kidneys, GRID))
    assert 600 < hu.max() < 1600


def test_there_is_gas_in_the_bowel(patient: PaintedBody) -> None:
    images = [truth(patient.slice(z, GRID), GRID) for z in (-70.0, -40.0, -10.0, 20.0)]
    assert sum((to_hu(image)[body_mask(image)] < -600).sum() for image in images) > 40


def test_organs_are_where_they_belong(patient: PaintedBody) -> None:
    kidneys, liver = patient.slice(KIDNEYS, GRID), patient.slice(LIVER, GRID)
    assert middle_of(liver, "liver")[0] < -30
    assert middle_of(liver, "spleen")[0] > 80
    assert middle_of(kidneys, "cortical bone")[1] < -30
    renal = kidneys.fractions[kidneys.materials.index("kidney")] > 0.3
    left, right = renal[:, GRID.x > 0].sum(), renal[:, GRID.x < 0].sum()
    assert min(left, right) > 100  # more than 600 mm² on either side


def test_the_lungs_reach_down_behind_the_diaphragm(patient: PaintedBody) -> None:
    hu = hu_where(patient.slice(DIAPHRAGM, GRID), "lung", 0.2)
    assert len(hu) > 200
    assert hu.median().item() < -700
    below = patient.slice(0.0, GRID)
    assert below.fractions[below.materials.index("lung")].max() == 0


def test_the_liver_has_texture_and_vessels(patient: PaintedBody) -> None:
    grid = ImageGrid(80, 80, spacing=1.0, center=(-90.0, 10.0))
    hu = to_hu(truth(patient.slice(LIVER, grid), grid))
    inside = hu[(hu > 60) & (hu < 200)]
    assert 2 < inside.std() < 30
    # What is far brighter than the grain is a vessel.
    assert (inside > inside.median() + 30).sum() > 30


def test_patients_are_scanned_with_and_without_contrast_medium(patient: PaintedBody, other: PaintedBody) -> None:
    without, enhanced = (hu_where(body.slice(LIVER, GRID), "liver").median().item() for body in (other, patient))
    assert without < 65 < 85 < enhanced
