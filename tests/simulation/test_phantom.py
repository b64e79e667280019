import numpy as np
import pytest
import torch

from pnpct.geometry import ImageGrid
from pnpct.simulation import Phantom, relative_attenuation, truth
from pnpct.units import to_hu

GRID = ImageGrid(12, 16, spacing=1.5)


def halves(upper: str, lower: str) -> Phantom:
    fractions = torch.zeros(2, 12, 16)
    fractions[0, :6] = fractions[1, 6:] = 1.0
    return Phantom((upper, lower), fractions, GRID)


def test_water_is_1_and_air_is_0_at_every_energy() -> None:
    for energy in (40.0, 70.0, 100.0):
        image = truth(halves("water", "air"), GRID, energy=energy)
        assert torch.equal(image[:6], torch.ones(6, 16))
        assert torch.equal(image[6:], torch.zeros(6, 16))


def test_hounsfield_units_follow_their_definition() -> None:
    mu = relative_attenuation(("muscle", "cortical bone", "water", "air"), np.array([55.0]))[:, 0]
    image = truth(halves("muscle", "cortical bone"), GRID, energy=55.0)
    assert to_hu(image)[0, 0].item() == pytest.approx(1000 * (mu[0] - mu[2]).item() / mu[2].item(), abs=0.01)
    assert to_hu(image)[-1, 0].item() == pytest.approx(1000 * (mu[1] - mu[2]).item() / mu[2].item(), abs=0.01)
    assert mu[3] == 0


@pytest.mark.parametrize(
    "grid",
    [
        ImageGrid(6, 8, spacing=3.0),
        ImageGrid(31, 47, spacing=1.0, center=(2.3, -1.7)),
        ImageGrid(7, 7, spacing=6.1, center=(-1.0, 1.0)),
    ],
)
def test_another_grid_gives_what_each_of_its_pixels_covers(grid: ImageGrid) -> None:
    # A box of water: columns 2 to 8, rows 3 to 4; all the rest is air, also beyond the phantom.
    water = torch.zeros(12, 16)
    water[3:5, 2:9] = 1.0
    left, right = GRID.x[2] - 0.75, GRID.x[8] + 0.75
    top, bottom = GRID.y[3] + 0.75, GRID.y[4] - 0.75
    half = grid.spacing / 2
    wide = np.clip(np.minimum(grid.x + half, right) - np.maximum(grid.x - half, left), 0, None)
    high = np.clip(np.minimum(grid.y + half, top) - np.maximum(grid.y - half, bottom), 0, None)
    expected = torch.from_numpy(high[:, None] * wide / grid.spacing**2).float()
    image = truth(Phantom(("water", "air"), torch.stack([water, 1 - water]), GRID), grid)
    torch.testing.assert_close(image, expected, rtol=0, atol=1e-6)


def test_its_own_grid_gives_the_pixels_themselves() -> None:
    water = torch.rand(12, 16, generator=torch.Generator().manual_seed(3))
    phantom = Phantom(("water", "air"), torch.stack([water, 1 - water]), GRID)
    torch.testing.assert_close(truth(phantom, GRID), water)


def test_impossible_phantoms_are_refused() -> None:
    with pytest.raises(ValueError, match='no material "gold"'):
        Phantom(("gold",), torch.ones(1, 12, 16), GRID)
    with pytest.raises(ValueError, match=r"have the shape \(1, 12, 16\), got \(2, 12, 16\)"):
        Phantom(("water",), torch.ones(2, 12, 16), GRID)
    with pytest.raises(ValueError, match="negative or not a number"):
        Phantom(("water", "air"), torch.stack([torch.full((12, 16), 1.5), torch.full((12, 16), -0.5)]), GRID)
    with pytest.raises(ValueError, match=r"sum to 1, air included; they sum to 0\.5000"):
        Phantom(("water",), torch.full((1, 12, 16), 0.5), GRID)
