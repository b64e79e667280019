import numpy as np
import pytest
import torch

from pnpct.evaluation import body_mask
from pnpct.geometry import ImageGrid
from pnpct.simulation import Phantom, head_body, truth
from pnpct.simulation.anatomy.folds import random_folds
from pnpct.simulation.anatomy.painted_body import PaintedBody
from pnpct.units import to_hu

GRID = ImageGrid(120, 120, spacing=2.0)
EYES, MIDDLE, ABOVE_THE_VENTRICLES = 38.0, 72.0, 104.0


@pytest.fixture(scope="module")
def patient() -> PaintedBody:
    return head_body(np.random.default_rng(3))


def hu_at(body: PaintedBody, x: float, y: float, z: float) -> float:
    """Median of 4 mm around a place, HU."""
    grid = ImageGrid(8, 8, spacing=0.5, center=(x, y))
    return to_hu(truth(body.slice(z, grid), grid)).median().item()


def fraction(phantom: Phantom, material: str) -> torch.Tensor:
    return phantom.fractions[phantom.materials.index(material)]


def test_one_seed_is_one_patient_and_another_seed_another(patient: PaintedBody) -> None:
    here = patient.slice(MIDDLE, GRID)
    again = head_body(np.random.default_rng(3)).slice(MIDDLE, GRID)
    assert again.materials == here.materials
    assert again.fractions.numpy().tobytes() == here.fractions.numpy().tobytes()
    other = head_body(np.random.default_rng(4)).slice(MIDDLE, GRID)
    assert (truth(other, GRID) - truth(here, GRID)).abs().mean() > 0.01


def test_one_seed_is_one_patient_on_every_grid(patient: PaintedBody) -> None:
    fine = patient.slice(EYES, ImageGrid(240, 240, spacing=1.0))
    difference = truth(fine, GRID) - truth(patient.slice(EYES, GRID), GRID)
    assert difference.mean().abs() < 0.003


@pytest.mark.parametrize("share", [0.0, 0.2, 0.4, 0.6, 0.8, 1.0])
def test_every_height_can_be_drawn_and_fits_the_field_of_view(patient: PaintedBody, share: float) -> None:
    phantom = patient.slice(share * patient.extent[1], GRID)
    assert phantom.fractions.min() >= 0
    torch.testing.assert_close(phantom.fractions.sum(0), torch.ones(GRID.shape))
    y, x = np.nonzero(body_mask(truth(phantom, GRID)).numpy())
    assert len(x) > 500  # 2000 mm²
    assert np.hypot(GRID.x[x], GRID.y[y]).max() < 118


@pytest.mark.parametrize("seed", [1, 2, 5])
def test_the_head_is_of_human_size(seed: int) -> None:
    body = head_body(np.random.default_rng(seed))
    y, x = np.nonzero(body_mask(truth(body.slice(80.0, GRID), GRID)).numpy())
    assert 140 < (np.ptp(x) + 1) * 2.0 < 175
    assert 175 < (np.ptp(y) + 1) * 2.0 < 215
    assert 130 < body.extent[1] < 165


def test_outside_the_extent_nothing_is_known(patient: PaintedBody) -> None:
    with pytest.raises(ValueError, match="reaches from"):
        patient.slice(patient.extent[1] + 1, GRID)


def test_neighbouring_slices_are_alike(patient: PaintedBody) -> None:
    here, beside, away = (truth(patient.slice(z, GRID), GRID) for z in (60.0, 60.6, 90.0))
    assert (beside - here).abs().mean() < 0.3 * (away - here).abs().mean()


@pytest.mark.parametrize("seed", [1, 2, 5])
def test_tissues_in_known_places_have_their_hounsfield_units(seed: int) -> None:
    body = head_body(np.random.default_rng(seed))
    for side in (-1, 1):
        thalamus, white = hu_at(body, side * 11.0, -11.0, 74.0), hu_at(body, side * 24.0, 0.0, ABOVE_THE_VENTRICLES)
        assert 34 < thalamus < 41
        assert 26 < white < 33
        assert thalamus - white > 3
    assert 4 < hu_at(body, 0.0, -23.0, 33.0) < 15  # the fourth ventricle
    assert 1300 < hu_at(body, 34.0, -7.5, 37.0) < 1700  # bone around the inner ear
    skull = to_hu(truth(body.slice(MIDDLE, GRID), GRID)).max().item()
    assert 800 < skull < 1700


def test_the_cortex_is_grey_and_the_middle_of_a_hemisphere_white(patient: PaintedBody) -> None:
    phantom = patient.slice(ABOVE_THE_VENTRICLES, GRID)
    grey, white = fraction(phantom, "brain grey matter"), fraction(phantom, "brain white matter")
    hu = to_hu(truth(phantom, GRID))
    pure_grey, pure_white = hu[grey > 0.8], hu[white > 0.8]
    assert len(pure_grey) > 200 < len(pure_white)
    assert pure_grey.median() - pure_white.median() > 5

    def radius(of: torch.Tensor) -> float:
        rows, cols = np.nonzero(of.numpy() > 0.8)
        return float(np.hypot(np.abs(GRID.x[cols]) - 22, GRID.y[rows]).mean())

    assert radius(grey) > radius(white) + 5


def test_the_cortex_is_folded(patient: PaintedBody) -> None:
    ring = ImageGrid(1, 360, spacing=0.5, center=(0.0, 35.0))
    fluid = fraction(patient.slice(110.0, ring), "cerebrospinal fluid")[0].numpy() > 0.2
    assert np.count_nonzero(np.diff(fluid.astype(int)) == 1) >= 5  # sulci on a line across the brain


def test_left_and_right_are_alike_but_not_the_same(patient: PaintedBody) -> None:
    image = truth(patient.slice(EYES, GRID), GRID).clamp(0, 2)
    blurred = torch.nn.functional.avg_pool2d(image[None], 10)[0]
    mirrored = blurred.flip(-1)
    pair = torch.stack([blurred.flatten(), mirrored.flatten()])
    assert torch.corrcoef(pair)[0, 1] > 0.93
    assert (image - image.flip(-1)).abs().mean() > 0.005


def test_there_is_air_in_the_sinuses_and_the_mastoid_cells_and_fat_behind_the_eyes(patient: PaintedBody) -> None:
    for name, (x, y, z), half in (("maxillary", (28.0, 62.0, 5.0), 8), ("mastoid", (55.0, -27.0, 20.0), 12)):
        for side in (-1, 1):
            grid = ImageGrid(2 * half, 2 * half, spacing=1.0, center=(side * x, y))
            assert fraction(patient.slice(z, grid), "air").mean() > 0.2, name
    for side in (-1, 1):
        behind = ImageGrid(20, 20, spacing=1.0, center=(side * 28.0, 46.0))
        assert fraction(patient.slice(EYES, behind), "adipose").mean() > 0.4
        assert 0 < hu_at(patient, side * 31.5, 66.0, EYES) < 25  # the eye itself


def test_age_and_anatomy_vary_between_patients() -> None:
    ventricles = []
    for seed in range(6):
        phantom = head_body(np.random.default_rng(seed)).slice(90.0, GRID)
        inner = (torch.from_numpy(GRID.x).abs() < 30)[None, :] & (torch.from_numpy(GRID.y).abs() < 45)[:, None]
        ventricles.append(4e-2 * float(fraction(phantom, "cerebrospinal fluid")[inner].sum()))  # cm²
    assert max(ventricles) > 1.4 * min(ventricles) > 0


def test_sheets_of_folds_are_half_a_wavelength_apart_where_one_wave_makes_them() -> None:
    folds = random_folds(np.random.default_rng(0), 12.0, count=1)
    (a, b, c), steps = folds.waves[0] / np.linalg.norm(folds.waves[0]), np.linspace(0, 60, 6001)
    distance = folds.distance(a * steps, b * steps, c * steps)
    sheets = steps[1:-1][(distance[1:-1] <= distance[:-2]) & (distance[1:-1] < distance[2:])]
    np.testing.assert_allclose(np.diff(sheets), 6.0, atol=0.03)
    between = (steps > sheets[0]) & (steps < sheets[-1])
    nearest = np.abs(steps[between, None] - sheets).min(axis=1)
    np.testing.assert_allclose(distance[between], nearest, atol=0.02)
