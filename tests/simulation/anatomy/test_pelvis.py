import numpy as np
import pytest
import torch

from pnpct.evaluation import body_mask
from pnpct.geometry import ImageGrid
from pnpct.simulation import Phantom, pelvis_body, truth
from pnpct.simulation.anatomy.painted_body import PaintedBody
from pnpct.units import to_hu

GRID = ImageGrid(180, 180, spacing=2.5)


@pytest.fixture(scope="module")
def patient() -> PaintedBody:
    return pelvis_body(np.random.default_rng(6))


@pytest.fixture(scope="module")
def other() -> PaintedBody:
    return pelvis_body(np.random.default_rng(22))


def hu_where(phantom: Phantom, material: str, share: float = 0.8) -> torch.Tensor:
    return to_hu(truth(phantom, GRID))[phantom.fractions[phantom.materials.index(material)] > share]


def test_one_seed_is_one_patient_and_another_seed_another(patient: PaintedBody, other: PaintedBody) -> None:
    here = patient.slice(0.0, GRID)
    again = pelvis_body(np.random.default_rng(6)).slice(0.0, GRID)
    assert again.materials == here.materials
    assert again.fractions.numpy().tobytes() == here.fractions.numpy().tobytes()
    assert (truth(other.slice(0.0, GRID), GRID) - truth(here, GRID)).abs().mean() > 0.01


def test_one_seed_is_one_patient_on_every_grid(patient: PaintedBody) -> None:
    fine = patient.slice(0.0, ImageGrid(360, 360, spacing=1.25))
    difference = truth(fine, GRID) - truth(patient.slice(0.0, GRID), GRID)
    assert difference.abs().mean() < 0.01
    assert difference.mean().abs() < 0.003


@pytest.mark.parametrize("share", [0.0, 0.2, 0.4, 0.6, 0.8, 1.0])
def test_every_height_is_a_human_slice(patient: PaintedBody, share: float) -> None:
    lowest, highest = patient.extent
    phantom = patient.slice(lowest + share * (highest - lowest), GRID)
    assert phantom.fractions.min() >= 0
    torch.testing.assert_close(phantom.fractions.sum(0), torch.ones(GRID.shape))
    y, x = np.nonzero(body_mask(truth(phantom, GRID)).numpy())
    assert 320 < (np.ptp(x) + 1) * 2.5 < 440
    assert 190 < (np.ptp(y) + 1) * 2.5 < 320
    assert np.hypot(GRID.x[x], GRID.y[y]).max() < 225


def test_outside_the_extent_nothing_is_known(patient: PaintedBody) -> None:
    with pytest.raises(ValueError, match="reaches from"):
        patient.slice(patient.extent[0] - 1, GRID)


def test_neighbouring_slices_are_alike(patient: PaintedBody) -> None:
    here, beside, away = (truth(patient.slice(z, GRID), GRID) for z in (0.0, 0.6, 40.0))
    assert (beside - here).abs().mean() < 0.2 * (away - here).abs().mean()


def test_tissues_have_their_hounsfield_units(patient: PaintedBody) -> None:
    phantom = patient.slice(0.0, GRID)
    assert hu_where(phantom, "muscle").median().item() == pytest.approx(36, abs=10)
    assert hu_where(phantom, "adipose").median().item() == pytest.approx(-72, abs=10)
    urine = hu_where(patient.slice(14.0, GRID), "water", 0.7)
    assert len(urine) > 100
    assert urine.median().item() == pytest.approx(5, abs=5)


def test_the_heads_of_the_femurs_are_spongy_bone_at_both_sides(patient: PaintedBody) -> None:
    hu = to_hu(truth(patient.slice(0.0, GRID), GRID))
    y = np.abs(GRID.y - 8) < 10
    for side in (-1, 1):
        head = hu[y][:, np.abs(GRID.x - side * 88) < 10]
        assert 60 < head.median() < 350
        assert head.std() > 5


@pytest.mark.parametrize(("z", "least"), [(-80.0, 250), (0.0, 700), (60.0, 700), (100.0, 700)])
def test_there_is_bone_at_every_height(patient: PaintedBody, z: float, least: int) -> None:
    phantom = patient.slice(z, GRID)
    bone = phantom.fractions[phantom.materials.index("cortical bone")]
    assert (bone > 0.05).sum() * 2.5**2 > least  # mm²
    sides = bone[:, GRID.x < 0].sum() / bone.sum()
    assert 0.4 < sides < 0.6


def test_photons_starve_from_side_to_side(patient: PaintedBody) -> None:
    image = truth(patient.slice(0.0, GRID), GRID)
    row = int(np.abs(GRID.y - 8).argmin())
    assert image[row].sum() * 2.5 > 1.3 * image[:, 90].sum() * 2.5


def test_some_patients_have_a_hip_of_metal(patient: PaintedBody, other: PaintedBody) -> None:
    assert "titanium" not in patient.materials
    phantom = other.slice(0.0, GRID)
    metal = phantom.fractions[phantom.materials.index("titanium")]
    _, x = np.nonzero(metal.numpy() > 0.5)
    assert len(x) > 60
    assert np.abs(np.abs(GRID.x[x].mean()) - 88) < 10  # one side
    assert to_hu(truth(phantom, GRID)).max() > 5000
