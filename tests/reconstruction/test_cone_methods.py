"""The methods on the projector of a cone beam."""

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
import torch

from pnpct.denoisers import AcrossSlices, Gaussian
from pnpct.geometry import ConeBeam, Detector, ImageGrid, Trajectory, VolumeGrid
from pnpct.operators import ConeProjector
from pnpct.physics import DiagonalWeights, Sinogram
from pnpct.reconstruction import FBP, TVPWLS, PlugAndPlay, Reconstruction, mean_diagonal, reconstruct_cone_volume
from pnpct.reconstruction.cone_volume import slice_distance
from pnpct.reconstruction.fourier import fourier_preconditioner
from pnpct.reconstruction.normal_equations import NormalOperator, conjugate_gradient
from pnpct.reconstruction.pnp_admm import ADMMState
from pnpct.reconstruction.tilted_volume import StartingImage, tilted_volume
from pnpct.reconstruction.whole_volume import whole_volume
from pnpct.reconstruction.without_air import inside, without_air_of

ANGLES = 2 * math.pi / 72 * np.arange(216)
HELIX = ConeBeam(
    Trajectory(ANGLES, z=20 * ANGLES / (2 * math.pi) - 30),
    Detector(bins=60, bin_width=14.0, offset=0.25, rows=12, row_height=3.0),
    source_to_isocenter=541.0,
    source_to_detector=949.0,
)
PLANE = ImageGrid(40, 40, spacing=10.0)
ROW = HELIX.row_height_at_isocenter
GRID = VolumeGrid(PLANE, 8, ROW)
LONG = VolumeGrid(PLANE, 44, ROW)
DISC = torch.from_numpy(np.hypot(PLANE.x - 75.0, PLANE.y[:, None] - 15.0) < 26.0)
BODY = torch.from_numpy(np.hypot(PLANE.x / 165.0, PLANE.y[:, None] / 125.0) < 1.0)


@pytest.fixture(scope="module")
def body() -> torch.Tensor:
    """A body that goes on beyond the scan, with one slice of a disc in slice 22 of `LONG`."""
    body = BODY.float().expand(LONG.shape).clone()
    body[22, DISC] += 0.8
    body[30:, 10:14, 10:14] += 0.3
    return body


@pytest.fixture(scope="module")
def sinogram(body) -> Sinogram:
    rays = ConeProjector(LONG, HELIX, mu_water=0.0193)(body)
    return Sinogram(rays, DiagonalWeights(1e5 * torch.exp(-rays), HELIX.shape))


@pytest.fixture(scope="module")
def A() -> ConeProjector:
    return ConeProjector(GRID, HELIX, mu_water=0.0193)


def of_views(sinogram: Sinogram, views: list[int]) -> Sinogram:
    line_integrals, weights = (array[views] for array in (sinogram.line_integrals, sinogram.weights.diagonal))
    return Sinogram(line_integrals, DiagonalWeights(weights, HELIX[views].shape))


def disc_hu(volume: torch.Tensor) -> float:
    inside = volume[:, DISC & (Gaussian(1.0)(DISC.float()) > 0.9)].mean(1)
    return 1000 * float(inside[4] - inside[0])  # the middles of both grids agree


@pytest.mark.parametrize(
    ("method", "least"),
    [(PlugAndPlay(AcrossSlices(Gaussian(0.3), agreement_hu=5.0), iterations=3), 650), (TVPWLS(0.2, iterations=3), 650)],
    ids=["pnp", "tv"],
)
def test_a_thin_disc_comes_back_in_the_cone_alone(sinogram, A, body, method, least):
    made = method(sinogram, A)
    assert made.image.shape == GRID.shape
    assert (made.iterations, made.stopped_by) == (3, "iterations")
    assert disc_hu(FBP()(sinogram, A).image) < 540 < least < disc_hu(made.image) < 900
    within = Gaussian(2.0)(BODY.float()) > 0.98
    error = (made.image - body[18:26])[:, within].square().mean().sqrt()
    assert float(error) < 0.06


def test_outer_slices_of_an_axial_scan_begin_nearer_to_the_truth_than_planes_are():
    circle = replace(HELIX, trajectory=Trajectory(ANGLES[:72]), detector=replace(HELIX.detector, rows=32))
    everything = VolumeGrid(PLANE, 64, ROW)
    body = BODY.float().expand(everything.shape).clone()
    body[45, DISC] += 0.8  # 23 mm above the middle
    rays = ConeProjector(everything, circle, mu_water=0.0193)(body)
    sinogram = Sinogram(rays, DiagonalWeights(1e5 * torch.exp(-rays), circle.shape))
    A = ConeProjector(VolumeGrid(PLANE, 4, ROW, z=14 * ROW), circle, mu_water=0.0193)
    whole, method = whole_volume(sinogram, A), TVPWLS(0.2, iterations=1)
    planes = ADMMState.start(tilted_volume(sinogram, whole.A, StartingImage(), plane_spacing=ROW))
    from_planes = whole.cut_out(next(method.states(whole.sinogram, whole.A, planes)).v)
    within = Gaussian(2.0)(BODY.float()) > 0.98
    now, before = (
        (image - body[44:48])[:, within].square().mean().sqrt() for image in (method(sinogram, A).image, from_planes)
    )
    assert float(now) < 0.85 * float(before)


def test_slices_of_a_volume_do_not_depend_on_the_slab_that_they_begin_with(sinogram, monkeypatch):
    rays = partial(of_views, sinogram)
    monkeypatch.setattr("pnpct.reconstruction.cone_volume.SLICES_OF_A_SLAB", 4)
    grid, method = VolumeGrid(PLANE, 6, ROW), FBP()
    whole = list(reconstruct_cone_volume(rays, HELIX, grid, method, mu_water=0.0193))
    assert [(slab.first, len(slab.image)) for slab in whole] == [(0, 4), (4, 2)]
    later = list(reconstruct_cone_volume(rays, HELIX, grid, method, mu_water=0.0193, first=3))
    assert [slab.first for slab in later] == [3, 4]
    assert torch.equal(torch.cat([slab.image for slab in later]), torch.cat([slab.image for slab in whole])[3:])


class Heights:
    """A method that gives each slice the square of its height."""

    settings: Mapping[str, Any] = {}

    def __call__(self, sinogram, A, *, progress=None):
        del sinogram, progress
        squares = torch.from_numpy(A.grid.heights**2).float()
        return Reconstruction(squares[:, None, None].expand(A.domain_shape), {})


@pytest.mark.parametrize(("thickness", "spread"), [(0.0, 0.0), (1.0, 0.0), (2.0, 1 / 2), (3.0, 2 / 3)])
def test_thick_slices_are_means_of_thin_ones(sinogram, thickness, spread):
    grid = VolumeGrid(PLANE, 3, 3 * ROW)
    slabs = reconstruct_cone_volume(
        lambda views: sinogram, HELIX, grid, Heights(), mu_water=0.0193, thickness=thickness * ROW
    )
    (slab,) = slabs
    expected = torch.from_numpy(grid.heights**2 + spread * ROW**2).float()
    torch.testing.assert_close(slab.image[:, 0, 0], expected)


def test_air_around_the_body_is_left_out(sinogram):
    plane = ImageGrid(168, 168, spacing=2.5)
    whole = whole_volume(sinogram, ConeProjector(VolumeGrid(plane, 2, ROW), HELIX, mu_water=0.0193))
    body = torch.from_numpy(np.hypot(plane.x / 165.0, plane.y[:, None] / 125.0) < 1.0).float()
    volume = body.expand(whole.A.domain_shape).clone()
    narrow = without_air_of(volume, whole)
    assert narrow.A.grid.plane.rows == 152
    assert float(narrow.A.support.double().mean()) < 0.9
    assert narrow.A.grid.slices == whole.A.grid.slices
    cut_out = narrow.cut_out(inside(volume, narrow.A.grid.plane))
    torch.testing.assert_close(cut_out, whole.cut_out(volume), rtol=0, atol=1e-3)
    change = narrow.sinogram.line_integrals - whole.sinogram.line_integrals
    assert float(change.abs().max()) < 1e-3


def test_fourier_needs_fewer_steps_than_none_in_space(sinogram, A, body):
    whole = whole_volume(sinogram, A)
    assert whole.A.grid.slices > GRID.slices + 2
    weights = whole.sinogram.weights
    beta = mean_diagonal(whole.sinogram, whole.A, torch.ones(whole.A.domain_shape))
    H = NormalOperator(whole.A, weights, beta)
    solution = body[22 - whole.A.grid.slices // 2 :][: whole.A.grid.slices]
    b, nothing = H(solution), torch.zeros(whole.A.domain_shape)
    errors = [
        whole.cut_out(conjugate_gradient(H, b, nothing, nothing, iterations=12, precondition=M)[0] - solution).norm()
        for M in (None, fourier_preconditioner(whole.sinogram, whole.A)(beta))
    ]
    assert errors[1] < 0.1 * errors[0]


def test_a_scan_is_read_some_views_at_a_time(sinogram, monkeypatch):
    """From counts to line integrals there are many more arrays than in the end."""
    asked = []

    def rays(views):
        asked.append(len(views))
        return of_views(sinogram, views)

    images = []
    for together in (1000, 50):
        monkeypatch.setattr("pnpct.reconstruction.cone_volume._TOGETHER", together)
        images += [slab.image for slab in reconstruct_cone_volume(rays, HELIX, GRID, FBP(), mu_water=0.0193)]
    assert asked[0] > 100
    assert asked[1:] == [50] * (asked[0] // 50) + [asked[0] % 50] * bool(asked[0] % 50)
    assert torch.equal(*images)


@pytest.mark.parametrize(("spacing", "thin"), [(1.0, 1), (1.00005, 1), (1.2, 2), (2.0, 2), (2.00005, 2), (2.1, 3)])
def test_a_slice_as_thick_as_a_row_by_its_name_is_not_divided(spacing, thin):
    """By the geometry of a scanner its rows of 0.625 mm are 0.62498 mm."""
    assert slice_distance(VolumeGrid(PLANE, 4, spacing * ROW), HELIX) == pytest.approx(spacing * ROW / thin)


def test_what_a_cone_beam_cannot_be_given(sinogram, A):
    with pytest.raises(
        ValueError, match="solver cholesky is for images of a fan beam; in a cone beam take fourier or cg"
    ):
        PlugAndPlay(Gaussian(1.0), solver="cholesky")(sinogram, A)
    with pytest.raises(ValueError, match="found in a first image; give one"):
        mean_diagonal(sinogram, A)
