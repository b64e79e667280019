from functools import cache

import numpy as np
import pytest
import torch

from pnpct.evaluation import body_mask, soft_tissue_mask
from pnpct.geometry import ImageGrid
from pnpct.simulation import Phantom, chest_body, truth
from pnpct.simulation.anatomy.painted_body import PaintedBody
from pnpct.units import to_hu

GRID = ImageGrid(180, 180, spacing=2.5)


@cache
def patient(seed: int) -> PaintedBody:
    return chest_body(np.random.default_rng(seed))


@pytest.fixture(scope="module")
def heart_level() -> Phantom:
    return patient(7).slice(0.0, GRID)


def test_one_seed_is_one_patient_and_another_seed_another(heart_level: Phantom) -> None:
    again = chest_body(np.random.default_rng(7)).slice(0.0, GRID)
    assert again.fractions.numpy().tobytes() == heart_level.fractions.numpy().tobytes()
    assert (truth(patient(1).slice(0.0, GRID), GRID) - truth(heart_level, GRID)).abs().mean() > 0.01


def test_one_seed_is_one_patient_on_every_grid(heart_level: Phantom) -> None:
    fine = patient(7).slice(0.0, ImageGrid(360, 360, spacing=1.25))
    difference = truth(fine, GRID) - truth(heart_level, GRID)
    assert difference.abs().mean() < 0.01
    assert difference.mean().abs() < 0.003


@pytest.mark.parametrize("z", [-110.0, -60.0, 60.0, 110.0, 150.0])
def test_every_height_is_a_human_slice(z: float) -> None:
    phantom = patient(1).slice(z, GRID)
    assert phantom.fractions.min() >= 0
    torch.testing.assert_close(phantom.fractions.sum(0), torch.ones(GRID.shape))
    y, x = np.nonzero(body_mask(truth(phantom, GRID)).numpy())
    assert 310 < (np.ptp(x) + 1) * 2.5 < 440
    assert 150 < (np.ptp(y) + 1) * 2.5 < 290
    assert np.hypot(GRID.x[x], GRID.y[y]).max() < 225


def test_neighbouring_slices_are_alike() -> None:
    here, beside, away = (truth(patient(7).slice(z, GRID), GRID) for z in (20.0, 20.6, 60.0))
    assert (beside - here).abs().mean() < 0.2 * (away - here).abs().mean()


def test_tissues_have_their_hounsfield_units(heart_level: Phantom) -> None:
    hu = to_hu(truth(heart_level, GRID))
    tissue = hu[soft_tissue_mask(truth(heart_level, GRID), margin=1)]
    assert tissue.quantile(0.02) > -100
    fat, muscle = tissue[tissue < -40], tissue[(tissue > 0) & (tissue < 70)]
    assert fat.median().item() == pytest.approx(-75, abs=10)
    assert muscle.median().item() == pytest.approx(35, abs=15)
    lung = hu[(hu > -950) & (hu < -700)]
    assert lung.median().item() == pytest.approx(-850, abs=40)
    # Cortical bone is thinner than these pixels.
    assert 500 < hu.max() < 1600


def test_the_heart_is_on_the_left_the_spine_at_the_back(heart_level: Phantom) -> None:
    x, y = torch.from_numpy(GRID.x).float(), torch.from_numpy(GRID.y).float()
    blood = heart_level.fractions[heart_level.materials.index("iodinated blood")]
    bone = heart_level.fractions[heart_level.materials.index("cortical bone")].clone()
    bone[:, (x.abs() > 30)] = 0
    assert ((blood * x).sum() / blood.sum()).item() == pytest.approx(25, abs=15)
    assert (bone * y[:, None]).sum() / bone.sum() < -30


def test_there_is_lung_above_the_diaphragm_and_liver_below_it() -> None:
    def lung_area(z: float) -> float:
        phantom = patient(7).slice(z, GRID)
        return float(phantom.fractions[phantom.materials.index("lung")].sum()) * GRID.spacing**2

    assert lung_area(0.0) > 9000
    assert lung_area(-105.0) < 0.6 * lung_area(0.0)
