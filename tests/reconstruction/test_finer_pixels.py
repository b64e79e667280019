"""Large pixels are divided where the data say more than they can hold, and averaged again."""

from dataclasses import replace
from itertools import islice

import pytest
import torch

from pnpct.denoisers import Gaussian
from pnpct.evaluation import body_mask, rmse_hu
from pnpct.files import load_denoiser
from pnpct.geometry import ImageGrid
from pnpct.operators import Projector
from pnpct.physics import DiagonalWeights, Sinogram, take_log
from pnpct.reconstruction import TVPWLS, ADMMState, PlugAndPlay, finer_pixels, methods
from pnpct.reconstruction.finer_pixels import on_finer_pixels
from pnpct.reconstruction.half_resolution import coarser_grid, doubled, halved
from pnpct.reconstruction.whole_object import Whole
from pnpct.simulation import example_scan

FEWER = {"size": 96, "views": 240, "bins": 200}


KNOWING = load_denoiser("n2n")


@pytest.fixture(scope="module")
def chest():
    scan, truth, grid = example_scan("chest", tube_current_ma=60.0, **FEWER)
    return take_log(scan), Projector(grid, scan.geometry, mu_water=scan.mu_water), truth


def test_edges_are_nearer_to_the_truth_on_the_pixels_that_were_asked_for(chest):
    sinogram, A, truth = chest
    divided = PlugAndPlay(KNOWING)(sinogram, A)
    as_asked = PlugAndPlay(replace(KNOWING, finest_pixel=None))(sinogram, A)

    def error(image):
        return rmse_hu(image, truth, mask=body_mask(truth))

    assert divided.image.shape == as_asked.image.shape == truth.shape
    assert error(divided.image) < 0.8 * error(as_asked.image)
    assert "averaged" in divided.notes[-1]
    assert not as_asked.notes


def test_a_grid_and_its_finer_one_have_the_same_borders(chest):
    _, A, truth = chest
    assert coarser_grid(A.grid.halved) == A.grid
    fine = doubled(truth, A.grid.halved.shape)
    whole = Whole(chest[0], Projector(A.grid.halved, A.geometry, mu_water=A.mu_water), A.grid)
    assert torch.equal(whole.cut_out(fine), halved(fine))
    part = ImageGrid(20, 24, A.grid.spacing, (2 * A.grid.spacing, 0.0))
    assert torch.equal(replace(whole, asked=part).cut_out(fine), halved(fine)[38:58, 38:62])


@pytest.mark.parametrize(
    "denoise", [Gaussian(0.5), replace(KNOWING, finest_pixel=None), replace(KNOWING, finest_pixel=6.0)]
)
def test_pixels_stay_where_the_denoiser_does_not_know_smaller_ones(chest, denoise):
    whole = Whole(*chest[:2], chest[1].grid)
    assert on_finer_pixels(whole, denoise) is whole
    assert on_finer_pixels(whole, KNOWING).A.grid == whole.asked.halved


def test_pixels_stay_where_noise_or_streaks_would_be_taken_for_anatomy(chest, monkeypatch):
    sinogram, A, truth = chest
    noisy = replace(sinogram, weights=DiagonalWeights(1e-4 * sinogram.weights.diagonal, A.geometry.shape))
    metal = torch.zeros_like(truth)
    metal[48:50, 48:50] = 12.0
    for rays in (noisy, replace(sinogram, line_integrals=sinogram.line_integrals + A(metal))):
        whole = Whole(rays, A, A.grid)
        assert on_finer_pixels(whole, KNOWING) is whole
    monkeypatch.setattr(finer_pixels, "FINEST", 0.1)
    with_more = ImageGrid(230, 230, A.grid.spacing * 96 / 230)  # more pixels than rays
    whole = Whole(*of_every(1, sinogram, A, with_more), with_more)
    assert on_finer_pixels(whole, KNOWING) is whole


def test_few_views_keep_no_pixel_whole_and_leave_less_room_for_streaks(chest, monkeypatch):
    sinogram, A, truth = chest
    few = of_every(4, sinogram, A, A.grid)
    whole = Whole(*few, A.grid)
    assert on_finer_pixels(whole, KNOWING).A.grid == A.grid.halved
    made = [method(*few) for method in (PlugAndPlay(KNOWING), TVPWLS())]
    assert "σ_v falls to 30 HU" in made[0].notes[-1]
    errors = [rmse_hu(each.image, truth, mask=body_mask(truth)) for each in made]
    assert errors[0] < 0.9 * errors[1]
    used = []

    def noting(*_, sigma_v, **__):
        used.append([*islice(sigma_v, 20)][-1])
        return iter(())

    monkeypatch.setattr(methods, "pnp_admm", noting)
    for rays in ((sinogram, A), of_every(4, sinogram, A, A.grid.halved)):
        PlugAndPlay(KNOWING, sigma_v=50.0).states(*rays, ADMMState.start(torch.ones(rays[1].grid.shape)))
    assert [float(last) for last in used] == [50.0, 25.0]


def of_every(number, sinogram, A, grid):
    """The rays of every so many views, and their projector."""
    geometry = A.geometry[::number]
    weights = DiagonalWeights(sinogram.weights.diagonal[::number], geometry.shape)
    rays = Sinogram(sinogram.line_integrals[::number], weights)
    return rays, Projector(grid, geometry, mu_water=A.mu_water)


def test_images_of_many_pixels_and_pixels_below_the_cells_of_the_detector_stay(chest, monkeypatch):
    sinogram, A, _ = chest
    whole = Whole(sinogram, A, A.grid)
    half_over_cell = A.grid.halved.spacing / A.geometry.bin_width_at_isocenter
    for limit, last, beyond in (
        ("LARGEST", A.grid.rows * A.grid.cols, A.grid.rows * A.grid.cols - 1),
        ("FINEST", 0.999 * half_over_cell, 1.001 * half_over_cell),
    ):
        with monkeypatch.context() as changed:
            changed.setattr(finer_pixels, limit, last)
            assert on_finer_pixels(whole, KNOWING).A.grid == A.grid.halved
            changed.setattr(finer_pixels, limit, beyond)
            assert on_finer_pixels(whole, KNOWING) is whole
