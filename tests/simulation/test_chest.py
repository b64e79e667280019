import numpy as np
import pytest
import torch

from pnpct.evaluation import body_mask, soft_tissue_mask
from pnpct.geometry import ImageGrid
from pnpct.simulation import Phantom, chest_phantom, truth
from pnpct.units import to_hu

GRID = ImageGrid(180, 180, spacing=2.5)


@pytest.fixture(scope="module")
def chest() -> Phantom:
    return chest_phantom(np.random.default_rng(7), grid=GRID)


def test_fractions_are_from_0_to_1_and_sum_to_1(chest: Phantom) -> None:
    assert chest.fractions.min() >= 0
    assert chest.fractions.max() <= 1 + 1e-6
    torch.testing.assert_close(chest.fractions.sum(0), torch.ones(GRID.shape))


def test_one_seed_is_one_patient_and_another_seed_another(chest: Phantom) -> None:
    again = chest_phantom(np.random.default_rng(7), grid=GRID)
    assert again.fractions.numpy().tobytes() == chest.fractions.numpy().tobytes()
    other = chest_phantom(np.random.default_rng(8), grid=GRID)
    assert (truth(other, GRID) - truth(chest, GRID)).abs().mean() > 0.01


def test_one_seed_is_one_patient_on_every_grid(chest: Phantom) -> None:
    fine = chest_phantom(np.random.default_rng(7), grid=ImageGrid(360, 360, spacing=1.25))
    difference = truth(fine, GRID) - truth(chest, GRID)
    assert difference.abs().mean() < 0.01
    assert difference.mean().abs() < 0.003


@pytest.mark.parametrize("seed", [1, 2])
def test_the_patient_is_of_human_size_and_inside_the_usual_field_of_view(seed: int) -> None:
    image = truth(chest_phantom(np.random.default_rng(seed), grid=GRID), GRID)
    body = body_mask(image)
    y, x = np.nonzero(body.numpy())
    assert 320 < (np.ptp(x) + 1) * 2.5 < 420
    assert 210 < (np.ptp(y) + 1) * 2.5 < 290
    assert np.hypot(GRID.x[x], GRID.y[y]).max() < 225


def test_tissues_have_their_hounsfield_units(chest: Phantom) -> None:
    hu = to_hu(truth(chest, GRID))
    tissue = hu[soft_tissue_mask(truth(chest, GRID), margin=1)]
    assert tissue.quantile(0.02) > -100
    fat, muscle = tissue[tissue < -40], tissue[(tissue > 0) & (tissue < 70)]
    assert fat.median().item() == pytest.approx(-75, abs=10)
    assert muscle.median().item() == pytest.approx(35, abs=15)
    lung = hu[(hu > -950) & (hu < -700)]
    assert lung.median().item() == pytest.approx(-850, abs=40)
    # Cortical bone is thinner than these pixels.
    assert 500 < hu.max() < 1600


def test_tissues_have_texture(chest: Phantom) -> None:
    fine = chest_phantom(np.random.default_rng(7), grid=ImageGrid(60, 60, spacing=1.0, center=(40.0, 20.0)))
    heart = to_hu(truth(fine, fine.grid))[20:40, 20:40]
    assert 1 < heart.std() < 15


def test_the_heart_is_on_the_left_the_spine_at_the_back(chest: Phantom) -> None:
    x, y = torch.from_numpy(GRID.x).float(), torch.from_numpy(GRID.y).float()
    blood = chest.fractions[chest.materials.index("iodinated blood")]
    bone = chest.fractions[chest.materials.index("cortical bone")].clone()
    bone[:, (x.abs() > 30)] = 0
    assert ((blood * x).sum() / blood.sum()).item() == pytest.approx(25, abs=15)
    assert (bone * y[:, None]).sum() / bone.sum() < -30
