"""Filtered back-projection of axial scans."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from ellipsoid_chords import MU_WATER, chords

from pnpct.geometry import ConeBeam, Detector, FanBeam, ImageGrid, Trajectory, VolumeGrid, evenly_spaced_views
from pnpct.operators import ConeProjector, Projector
from pnpct.physics import DiagonalWeights, Sinogram
from pnpct.reconstruction import FBP, fbp, fdk, reconstruct_cone_volume

DETECTOR = Detector(bins=180, bin_width=3.0, offset=0.25, rows=16, row_height=2.2)
VIEWS, SHORT = 180, 120
CIRCLE = ConeBeam(Trajectory(evenly_spaced_views(VIEWS), z=[3.0] * VIEWS), DETECTOR, 541.0, 949.0)
FLYING = [(0.4 * (view % 2) - 0.2, 5.45 * (view % 2), -0.66 * (view % 2)) for view in range(VIEWS)]
OVER = evenly_spaced_views(SHORT, start=0.4, span=CIRCLE.short_scan + 0.05)
SCANNERS = {
    "arc": CIRCLE,
    "flat": replace(CIRCLE, detector=replace(DETECTOR, kind="flat", row_offset=0.25)),
    "flying focal spot": replace(CIRCLE, trajectory=replace(CIRCLE.trajectory, focal_spot_shifts=FLYING)),
    "short scan": replace(CIRCLE, trajectory=Trajectory(OVER, z=[3.0] * SHORT)),
    "flat, short scan": replace(
        CIRCLE, trajectory=Trajectory(OVER, z=[3.0] * SHORT), detector=replace(DETECTOR, kind="flat")
    ),
    "detector moved aside": replace(CIRCLE, detector=replace(DETECTOR, bins=110, offset=35.25)),
}
PLANE = ImageGrid(60, 60, spacing=4.0)
ROW = CIRCLE.row_height_at_isocenter
GRID = VolumeGrid(PLANE, slices=15, slice_spacing=ROW, z=3.0)
ASIDE = ((20.0, -10.0, 0.0), (80.0, 80.0, 1e6), 1.0)


def volume_of(geometry: ConeBeam, *ellipsoids: tuple, grid: VolumeGrid = GRID) -> np.ndarray:
    return fdk(chords(geometry, *ellipsoids), ConeProjector(grid, geometry, mu_water=MU_WATER), kernel="hann").numpy()


def within(radius: float, center: tuple[float, ...] = (20.0, -10.0)) -> np.ndarray:
    return np.hypot(PLANE.x - center[0], PLANE.y[:, None] - center[1]) < radius


@pytest.mark.parametrize("name", SCANNERS)
def test_a_cylinder_along_z_is_water_in_all_slices(name):
    volume = volume_of(SCANNERS[name], ASIDE)
    for image in volume:
        assert image[within(72.0)].mean() == pytest.approx(1.0, abs=0.002)
        assert np.abs(image[within(72.0)] - 1).max() < 0.01
        assert abs(image[~within(88.0) & within(115.0, (0.0, 0.0))].mean()) < 0.003


@pytest.mark.parametrize("name", SCANNERS)
def test_a_ball_off_the_plane_of_the_circle_is_where_it_is(name):
    center, radius = (48.0, 30.0, 5.5), 9.0
    grid = VolumeGrid(ImageGrid(28, 28, spacing=1.0, center=(47.0, 31.0)), 15, ROW, z=5.0)
    volume = volume_of(SCANNERS[name], (center, (radius, radius, 3.0), 1.0), grid=grid).astype(float)
    z, y, x = np.meshgrid(grid.heights, grid.plane.y, grid.plane.x, indexing="ij")
    volume[np.hypot(x - center[0], y - center[1]) > radius + 3] = 0
    found = [(volume * along).sum() / volume.sum() for along in (x, y, z)]
    assert found == pytest.approx(center, abs=0.1)
    assert volume[7, np.hypot(x - center[0], y - center[1])[7] < 4].mean() == pytest.approx(1.0, abs=0.015)


def test_arc_and_flat_detectors_agree():
    body, ball = ((0.0, 5.0, 0.0), (90.0, 70.0, 1e6), 1.0), ((40.0, 10.0, 6.0), (15.0, 15.0, 4.0), 0.3)
    arc, flat = (
        volume_of(replace(CIRCLE, detector=replace(DETECTOR, kind=kind)), body, ball) for kind in ("arc", "flat")
    )
    inside = within(60.0, (0.0, 5.0))
    assert np.abs(arc - flat)[:, inside].max() < 0.03
    assert np.sqrt(np.square(arc - flat)[:, inside].mean()) < 0.003


@pytest.mark.parametrize("kind", ["arc", "flat"])
def test_one_row_is_the_fan_beam(kind):
    geometry = replace(CIRCLE, detector=replace(DETECTOR, rows=1, kind=kind))
    rays = chords(geometry, ASIDE)
    grid = VolumeGrid(PLANE, 3, 20.0, z=3.0)
    volume = fdk(rays, ConeProjector(grid, geometry, mu_water=MU_WATER), kernel="hann")
    fan = FanBeam.from_cone_beam(geometry)
    image = fbp(rays[:, 0], Projector(PLANE, fan, mu_water=MU_WATER), kernel="hann")
    torch.testing.assert_close(volume, image.expand(3, -1, -1), rtol=1e-4, atol=1e-4)


def test_fbp_is_feldkamps_on_a_circle_says_so_and_has_slabs(monkeypatch):
    rays = chords(CIRCLE, ASIDE, ((48.0, 30.0, 5.5), (9.0, 9.0, 3.0), 1.0))
    sinogram = Sinogram(rays, DiagonalWeights(torch.ones_like(rays), CIRCLE.shape))
    A = ConeProjector(GRID, CIRCLE, mu_water=MU_WATER)
    made = FBP("soft")(sinogram, A)
    assert torch.equal(made.image, fdk(rays, A, kernel="soft"))
    assert made.notes[0].startswith(
        "Feldkamp's reconstruction is exact at z = 3 mm, and approximate away from there; below"
    )
    few = FBP("soft")(sinogram, ConeProjector(replace(GRID, slices=3), CIRCLE, mu_water=MU_WATER))
    assert few.notes == ("Feldkamp's reconstruction is exact at z = 3 mm, and approximate away from there.",)
    torch.testing.assert_close(few.image, made.image[6:9], rtol=1e-4, atol=1e-5)
    monkeypatch.setattr("pnpct.reconstruction.cone_volume.SLICES_OF_A_SLAB", 6)
    slabs = reconstruct_cone_volume(lambda views: sinogram, CIRCLE, GRID, FBP("soft"), mu_water=MU_WATER)
    torch.testing.assert_close(torch.cat([slab.image for slab in slabs]), made.image, rtol=1e-4, atol=1e-5)


def test_what_reaches_beyond_the_fan_is_continued():
    rays = chords(CIRCLE, ((0.0, 0.0, 0.0), (200.0, 120.0, 1e6), 1.0))
    sinogram = Sinogram(rays, DiagonalWeights(torch.ones_like(rays), CIRCLE.shape))
    made = FBP()(sinogram, ConeProjector(GRID, CIRCLE, mu_water=MU_WATER))
    assert "The object reaches beyond the fan" in made.notes[0]
    assert np.abs(made.image.numpy()[:, within(80.0, (0.0, 0.0))] - 1).max() < 0.03


def test_a_batch_is_its_scans_with_gradients(generator):
    geometry = SCANNERS["flying focal spot"][::12]
    A = ConeProjector(replace(GRID, slices=4), geometry, mu_water=MU_WATER)
    y = torch.randn(2, *geometry.shape, generator=generator).requires_grad_()
    x = torch.randn(2, *A.domain_shape, generator=generator)
    volume = fdk(y, A)
    torch.testing.assert_close(volume[1], fdk(y[1], A))
    (gradient,) = torch.autograd.grad((volume * x).sum(), y)
    inner, scale = (volume * x).sum().item(), (volume.norm() * x.norm()).item()
    assert abs((gradient * y).sum().item() - inner) < 1e-5 * scale
