from dataclasses import replace

import numpy as np
import pytest
import torch

from pnpct.denoisers import Gaussian
from pnpct.files import ImageSeries, read_volume
from pnpct.geometry import ImageGrid
from pnpct.simulation import CTBody, truth
from pnpct.units import to_hu

BONE_HU = 1560.0
GRID = ImageGrid(6, 8, spacing=1.5)


def series_of(image_hu: np.ndarray, *, z: tuple[float, ...] = (0.0,), grid: ImageGrid = GRID) -> ImageSeries:
    return ImageSeries(image_hu.reshape(len(z), *grid.shape), grid, z, "made for a test")


@pytest.fixture
def ramp() -> ImageSeries:
    """Every HU from far below air to far above bone, in tenths."""
    grid = ImageGrid(101, 401, spacing=1.0)
    return series_of(np.linspace(-1200.0, 2850.0, 101 * 401, dtype=np.float32), grid=grid)


@pytest.fixture
def noise() -> ImageSeries:
    """Soft tissue in four slices, none like another."""
    return series_of(np.random.default_rng(3).integers(-150, 250, (4, 6, 8), dtype=np.int16), z=(-2.0, 1.0, 4.0, 7.5))


def hu_of(body: CTBody, z: float, grid: ImageGrid) -> torch.Tensor:
    return to_hu(truth(body.slice(z, grid), grid, energy=70.0))


def test_the_attenuation_at_70_kev_is_that_of_the_images(ramp):
    image = torch.from_numpy(ramp.image_hu[0]).clamp(min=-1000.0)
    hu = hu_of(CTBody(ramp), 0.0, ramp.plane)
    known = image <= BONE_HU
    torch.testing.assert_close(hu[known], image[known], rtol=0, atol=0.01)
    assert hu[~known].sub(BONE_HU).abs().max() < 1.0


def test_fractions_are_shares_and_continuous(ramp):
    fractions = CTBody(ramp).slice(0.0, ramp.plane).fractions.flatten(1)
    assert fractions.min() >= 0
    torch.testing.assert_close(fractions.sum(dim=0), torch.ones(fractions.shape[1]))
    # A tenth of an HU apart: the steepest share is that of fat, all of it within 23 HU.
    assert fractions.diff(dim=1).abs().max() < 0.1 / 15


@pytest.mark.parametrize(
    ("hu", "expected"),
    [
        (-1024, {"air"}),
        (-1000, {"air"}),
        (-850, {"air", "lung"}),
        (-600, {"lung", "muscle"}),
        (-100, {"adipose"}),
        (0, {"adipose", "muscle"}),
        (43, {"muscle"}),
        (300, {"muscle", "cortical bone"}),
        (3000, {"cortical bone"}),
    ],
)
def test_tissues_are_what_is_expected_at_their_hu(hu, expected):
    phantom = CTBody(series_of(np.full((1, 6, 8), hu, np.int16))).slice(0.0, GRID)
    shares = dict(zip(phantom.materials, phantom.fractions[:, 0, 0].tolist(), strict=True))
    assert {material for material, share in shares.items() if share > 0.03} == expected


def test_other_energies_tell_bone_from_soft_tissue():
    series = series_of(np.repeat(np.array([-90, 1500], np.int16), 24))
    low, high = (to_hu(truth(CTBody(series).slice(0.0, GRID), GRID, energy=energy)) for energy in (50.0, 90.0))
    assert low[0, 0] < high[0, 0] < -70
    assert low[-1, 0] > 2000 > 1300 > high[-1, 0]


def test_between_two_images_it_is_linear_in_z(noise):
    body = CTBody(noise)
    assert body.extent == (-2.0, 7.5)
    images = torch.from_numpy(noise.image_hu).float()
    for at, z in enumerate(noise.z):
        torch.testing.assert_close(hu_of(body, z, GRID), images[at], rtol=0, atol=0.01)
    torch.testing.assert_close(hu_of(body, 1.75, GRID), 0.75 * images[1] + 0.25 * images[2], rtol=0, atol=0.01)
    torch.testing.assert_close(hu_of(body, 5.4, GRID), 0.6 * images[2] + 0.4 * images[3], rtol=0, atol=0.01)


@pytest.mark.parametrize("z", [-2.01, 7.51, float("nan")])
def test_heights_outside_the_images_are_refused(noise, z):
    with pytest.raises(ValueError, match=r"The images reach from z = -2 to 7\.5 mm, but"):
        CTBody(noise).slice(z, GRID)


def test_larger_pixels_are_averages(noise):
    coarse = hu_of(CTBody(noise), 1.0, ImageGrid(2, 2, spacing=4.5, center=(-1.5, 0.0)))
    blocks = torch.from_numpy(noise.image_hu[1, :, :6]).float().reshape(2, 3, 2, 3).mean(dim=(1, 3))
    torch.testing.assert_close(coarse, blocks, rtol=0, atol=0.01)


def test_smaller_pixels_follow_a_plane():
    plane = 20 * GRID.x[None, :] - 7 * GRID.y[:, None]
    body = CTBody(series_of(plane.astype(np.float32)))
    fine = ImageGrid(11, 17, spacing=0.4, center=(0.3, -0.2))
    expected = 20 * fine.x[None, :] - 7 * fine.y[:, None]
    np.testing.assert_allclose(hu_of(body, 0.0, fine), expected, rtol=0, atol=0.01)


@pytest.mark.parametrize("spacing", [0.5, 1.5, 4.0])
def test_beyond_the_images_is_air(spacing):
    body = CTBody(series_of(np.zeros((1, 6, 8), np.int16)))
    hu = hu_of(body, 0.0, ImageGrid(3, 3, spacing=spacing, center=(30.0, 30.0)))
    torch.testing.assert_close(hu, torch.full((3, 3), -1000.0))


@pytest.mark.parametrize("spacing", [0.5, 4.0])
def test_the_mass_does_not_depend_on_the_grid(noise, spacing):
    wide = ImageGrid(round(30 / spacing), round(30 / spacing), spacing=spacing)
    body = CTBody(noise)
    mass = truth(body.slice(2.0, wide), wide).sum().item() * spacing**2
    assert mass == pytest.approx(truth(body.slice(2.0, GRID), GRID).sum().item() * 1.5**2, rel=1e-3)


def test_noise_is_removed_before_tissues_are_told_apart(noise):
    denoise = Gaussian(0.8)
    denoised = to_hu(denoise(torch.from_numpy(noise.image_hu[1]).float() / 1000 + 1))
    torch.testing.assert_close(hu_of(CTBody(noise, denoise=denoise), 1.0, GRID), denoised, rtol=0, atol=0.01)


def test_where_the_scanner_had_the_images_does_not_matter(noise):
    aside = replace(noise, plane=replace(noise.plane, center=(31.0, -170.5)))
    for grid in (GRID, replace(GRID, spacing=2.1), replace(GRID, spacing=0.7)):
        assert torch.equal(CTBody(aside).slice(2.0, grid).fractions, CTBody(noise).slice(2.0, grid).fractions)


def test_a_real_chest_keeps_its_hu(shared_data):
    series = read_volume(shared_data / "ct_series" / "chest.npz")
    for at in (0, 50, 101):
        image = torch.from_numpy(series.image_hu[at]).float().clamp(-1000.0, BONE_HU)
        hu = hu_of(CTBody(series), series.z[at], series.plane)
        assert (hu - image).abs().max() < 1.0
