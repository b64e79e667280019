"""Iterations leave out the air around the object, and nothing else."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.ndimage import binary_erosion

from pnpct.geometry import FanBeam, ImageGrid, evenly_spaced_views
from pnpct.operators import Projector
from pnpct.physics import DiagonalWeights, Sinogram
from pnpct.reconstruction import TVPWLS, methods
from pnpct.reconstruction.whole_object import RIM, Whole
from pnpct.reconstruction.without_air import MARGIN, inside, without_air, without_air_of

GEOMETRY = FanBeam(evenly_spaced_views(90), 100, source_to_isocenter=541.0, source_to_detector=949.0, bin_width=8.0)
GRID = ImageGrid(160, 160, spacing=2.5)
FOAM = 0.06


def body(grid: ImageGrid) -> torch.Tensor:
    x, y = torch.from_numpy(grid.x), torch.from_numpy(grid.y[:, None].copy())
    return ((((x + 20) / 110) ** 2 + (y / 70) ** 2) < 1).float()


def foam(grid: ImageGrid) -> torch.Tensor:
    """Below the body, 32 mm thick."""
    x, y = torch.from_numpy(grid.x), torch.from_numpy(grid.y[:, None].copy())
    return FOAM * ((y < -144) & (y > -176) & (x.abs() < 60)).float()


def of(image: torch.Tensor, grid: ImageGrid = GRID, geometry: FanBeam = GEOMETRY, quanta: float = 1e5) -> Whole:
    A = Projector(grid, geometry, mu_water=0.0193)
    rays = A(image)
    return Whole(Sinogram(rays, DiagonalWeights(quanta * torch.exp(-rays))), A, grid)


@pytest.mark.parametrize("grid", [GRID, replace(GRID, cols=173), replace(GRID, center=(-12.0, 8.0))])
def test_the_pixels_that_stay_hold_the_object_where_it_was(grid):
    image = body(grid)
    whole = without_air_of(image, of(image, grid))
    part = inside(image, whole.A.grid)
    assert whole.A.grid.rows < 120
    assert whole.A.grid.cols < grid.cols
    assert float(whole.cut_out(torch.zeros_like(part)).max()) < 0.01
    ones = whole.cut_out(torch.ones_like(part)) == 1
    within_rim = binary_erosion(whole.A.support.numpy(), np.ones((2 * RIM + 1, 2 * RIM + 1)))
    assert np.array_equal(inside(ones, whole.A.grid).numpy(), within_rim)
    assert int(ones.sum()) == int(within_rim.sum())
    assert torch.equal(whole.cut_out(part)[image > 0], image[image > 0])
    assert whole.cut_out(part).shape == grid.shape
    for axis in (0, 1):
        at = torch.from_numpy(np.stack(np.meshgrid(whole.A.grid.x, whole.A.grid.y))[axis]).float()
        everywhere = torch.from_numpy(np.stack(np.meshgrid(grid.x, grid.y))[axis]).float()
        assert torch.allclose(whole.cut_out(at)[image > 0], everywhere[image > 0])


def test_rays_lose_what_they_meet_around():
    image = body(GRID) + foam(GRID)
    before = of(image)
    whole = without_air_of(image, before)
    around = whole.cut_out(torch.zeros(whole.A.domain_shape))
    together = whole.A(inside(image, whole.A.grid)) + before.A(around)
    assert float(together.sum()) == pytest.approx(float(before.sinogram.line_integrals.sum()), rel=2e-3)
    assert float((together - before.sinogram.line_integrals).abs().max()) < 0.06  # foam is blurred
    assert float((before.sinogram.line_integrals - whole.sinogram.line_integrals).max()) > 0.03


def test_foam_stays_and_the_body_does_not_get_it(monkeypatch, generator):
    image = body(GRID) + foam(GRID)
    whole = of(image)
    noise = torch.randn(GEOMETRY.shape, generator=generator) * whole.sinogram.weights.diagonal.rsqrt()
    sinogram = replace(whole.sinogram, line_integrals=whole.sinogram.line_integrals + noise)
    seen = []

    def watched(whole):
        seen.append(without_air(whole))
        return seen[-1]

    monkeypatch.setattr(methods, "without_air", watched)
    made = TVPWLS()(sinogram, whole.A).image
    monkeypatch.setattr(methods, "without_air", lambda whole: (whole, None))
    of_all = TVPWLS()(sinogram, whole.A).image
    assert seen[0][0].A.grid.rows < 120
    inside = body(GRID) > 0
    assert 1000 * float((made - of_all)[inside].square().mean().sqrt()) < 6
    assert abs(1000 * float((made - of_all)[inside].mean())) < 0.3
    below = GRID.y < -100
    assert float(made[below].sum()) == pytest.approx(float(foam(GRID).sum()), rel=0.1)


@pytest.mark.parametrize(
    "kind", ["all of the image", "nothing", "limited angle", "few views", "at the border", "metal"]
)
def test_else_all_pixels_stay(kind):
    image = {"nothing": torch.zeros(GRID.shape), "limited angle": body(GRID), "few views": body(GRID)}.get(
        kind, torch.ones(GRID.shape)
    )
    if kind == "at the border":
        image = torch.roll(body(GRID), 38, dims=-1)
    if kind == "metal":
        image = body(GRID)
        image[76:84, 70:78] = 8.0
    geometry = {"limited angle": GEOMETRY[:25], "few views": GEOMETRY[::4]}.get(kind, GEOMETRY)
    whole = of(image, geometry=geometry)
    assert without_air_of(image, whole) is whole


def test_where_nothing_is_left_out_the_image_has_no_rim():
    tall = body(ImageGrid(160, 160, spacing=2.0)).T.contiguous()  # reaches the border of a smaller grid
    grid = ImageGrid(96, 160, spacing=2.5)
    image = tall[32:128]
    whole = without_air_of(image, of(image, grid))
    assert whole.A.grid.rows == 96
    assert whole.A.grid.cols < 160
    ones = whole.cut_out(torch.ones(whole.A.domain_shape)) == 1
    assert bool(ones[:, 80].all())
    assert int(ones[48].sum()) == int(whole.A.support[48].sum()) - 2 * RIM


def test_the_support_is_round_where_the_object_is():
    x, y = torch.from_numpy(GRID.x), torch.from_numpy(GRID.y[:, None].copy())
    disc = (torch.hypot(x - 15, y + 10) < 80).float()
    whole = without_air_of(disc, of(disc))
    x, y = torch.from_numpy(whole.A.grid.x), torch.from_numpy(whole.A.grid.y[:, None].copy())
    farthest = torch.hypot(x - 15, y + 10)[whole.A.support].max()
    assert 80 + 2.5 * MARGIN < farthest < 80 + 2.5 * (MARGIN + 12)
    assert float(whole.A.support.double().mean()) < 0.85


def test_a_batch_keeps_what_any_of_it_needs():
    wide, high = body(GRID), body(GRID).T.contiguous()
    both = torch.stack([wide, high])
    whole = without_air_of(both, of(both))
    assert 120 < min(whole.A.grid.shape) < 160
    assert torch.equal(whole.cut_out(inside(both, whole.A.grid))[1][high > 0], high[high > 0])


def test_noise_in_corners_that_no_view_sees_is_no_object():
    corners = torch.from_numpy(np.hypot(GRID.x, GRID.y[:, None]) > GEOMETRY.field_of_view_radius + 8)
    assert bool(corners.any())
    whole = without_air_of(body(GRID) + 0.5 * corners, of(body(GRID)))
    assert whole.A.grid.rows < 120
