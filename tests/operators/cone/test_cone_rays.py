"""What a ray of a cone beam meets, against closed forms and against the fan beam."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from cone_worlds import CIRCLE, DETECTOR, PLANE

from pnpct.geometry import ConeBeam, Detector, FanBeam, ImageGrid, Trajectory, VolumeGrid, evenly_spaced_views
from pnpct.operators import ConeProjector, Projector

FINE = Detector(bins=161, bin_width=5.0, offset=0.25, rows=32, row_height=4.0)
TURN = evenly_spaced_views(13, start=0.1)
TRAJECTORIES = {
    "circle": Trajectory(TURN),
    "helix": Trajectory(TURN, z=[-13.0 + 2 * view for view in range(13)]),
    "moving focal spot": Trajectory(
        TURN,
        z=[-13.0 + 2 * view for view in range(13)],
        focal_spot_shifts=[(2.0 * (n % 2), 5.0 * (n % 2), -0.7 * (n % 3)) for n in range(13)],
    ),
}


def chords(geometry: ConeBeam, center: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """Lengths of the central rays in an ellipsoid, mm."""
    spots = geometry.focal_spots()[:, None, None]
    cells = geometry.detector_points(geometry.fan_angles)[:, None] + np.zeros((1, geometry.rows, 1, 1))
    cells[..., 2] += geometry.detector.row_positions[:, None]
    length = np.linalg.norm(cells - spots, axis=-1)
    towards, begin = (cells - spots) / axes, (spots - center) / axes
    a, b = (towards**2).sum(-1), (begin * towards).sum(-1)
    inside = b**2 - a * ((begin**2).sum(-1) - 1)
    return 2 * np.sqrt(np.maximum(inside, 0)) / a * length


def ellipsoid(grid: VolumeGrid, center: np.ndarray, axes: np.ndarray, fine: int = 3) -> torch.Tensor:
    """The part of each voxel that is in an ellipsoid."""
    part = (np.arange(fine) + 0.5) / fine - 0.5
    x, y, z = (
        ((at[:, None] + part * step).reshape(-1) - middle) / axis
        for at, step, middle, axis in zip(
            (grid.plane.x, grid.plane.y, grid.heights),
            (grid.plane.spacing, -grid.plane.spacing, grid.slice_spacing),
            center,
            axes,
            strict=True,
        )
    )
    inside = z[:, None, None] ** 2 + y[None, :, None] ** 2 + x**2 < 1
    sides = [side for count in grid.shape for side in (count, fine)]
    return torch.from_numpy(inside.reshape(sides).mean((1, 3, 5))).float()


@pytest.mark.parametrize("kind", ["arc", "flat"])
@pytest.mark.parametrize("trajectory", TRAJECTORIES)
def test_chords_of_ellipsoids_are_those_of_geometry(trajectory, kind):
    geometry = ConeBeam(TRAJECTORIES[trajectory], replace(FINE, kind=kind), 541.0, 949.0)
    grid = VolumeGrid(ImageGrid(120, 120, spacing=2.0), 60, 2.0)
    center, axes = np.array([25.0, -18.0, 4.0]), np.array([70.0, 50.0, 35.0])
    expected = chords(geometry, center, axes)
    projected = ConeProjector(grid, geometry, mu_water=1.0)(ellipsoid(grid, center, axes)).numpy()
    well_inside = expected > 0.5 * expected.max()
    assert np.abs(projected - expected)[well_inside].max() < 1.4  # a voxel is 2 mm
    # Chords of 100 mm bend by this over cells of 2.9 x 2.3 mm and voxels of 2 mm: half the second derivative times σ².
    assert -0.2 < (projected - expected)[well_inside].mean() < 0.0
    inside_the_beam = np.s_[:, 2:-2]
    assert projected[inside_the_beam].sum() == pytest.approx(expected[inside_the_beam].sum(), rel=2e-3)


@pytest.mark.parametrize("kind", ["arc", "flat"])
def test_one_row_and_a_thick_slice_are_a_fan_beam(kind, generator):
    detector = replace(DETECTOR, kind=kind, rows=1, row_height=1.0)
    shifts = [(1.5 * (view % 2), 3.0 * (view % 2), 0.0) for view in range(24)]
    cone = replace(CIRCLE, detector=detector, trajectory=replace(CIRCLE.trajectory, focal_spot_shifts=shifts))
    image = torch.rand(PLANE.shape, generator=generator)
    expected = Projector(PLANE, FanBeam.from_cone_beam(cone))(image)
    projected = ConeProjector(VolumeGrid(PLANE, 1, 10.0), cone)(image[None])
    torch.testing.assert_close(projected[:, 0], expected, rtol=1e-5, atol=1e-5 * float(expected.max()))


def test_what_is_the_same_along_z_is_a_fan_beam_with_longer_paths(generator):
    image = torch.rand(PLANE.shape, generator=generator)
    expected = Projector(PLANE, FanBeam.from_cone_beam(CIRCLE))(image)
    projected = ConeProjector(VolumeGrid(PLANE, 40, 4.0), CIRCLE)(image.expand(40, -1, -1))
    longer = torch.from_numpy(np.hypot(1, CIRCLE.detector.row_positions / CIRCLE.source_to_detector)).float()
    expected = expected[:, None] * longer[:, None]
    torch.testing.assert_close(projected, expected, rtol=1e-5, atol=1e-5 * float(expected.max()))


def test_the_highest_row_sees_what_is_towards_the_head():
    grid = VolumeGrid(ImageGrid(64, 64, spacing=4.0), 32, 2.0)
    volume = torch.zeros(grid.shape)
    volume[26, 32, 32] = 1.0  # 21 mm up, on the axis
    detector = replace(DETECTOR, rows=16, row_height=5.0)
    geometry = replace(CIRCLE, detector=detector, trajectory=Trajectory((0.0, 0.0), z=(0.0, 21.0)))
    rows = ConeProjector(grid, geometry)(volume).sum(-1).numpy()
    seen = (rows @ detector.row_positions) / rows.sum(1)
    assert seen == pytest.approx([21 * 949 / 541, 0.0], abs=1.0)


def shared_and_exact(monkeypatch, bound: str, bins: int) -> tuple[torch.Tensor, torch.Tensor]:
    """A thin disc far from the middle, seen by each row, with shared heights and with a bound of them set to 0."""
    grid = VolumeGrid(ImageGrid(128, 128, spacing=3.9), 33, 0.625)
    volume = torch.zeros(grid.shape)
    volume[26, 30:34, 60:68] = 1.0
    detector = Detector(bins=bins, bin_width=904 / bins, rows=32, row_height=0.625 * 949 / 541)
    geometry = ConeBeam(Trajectory(evenly_spaced_views(12)), detector, 541.0, 949.0)
    shared = ConeProjector(grid, geometry)(volume)
    monkeypatch.setattr(f"pnpct.operators.cone.cone_lines.{bound}", 0.0)
    return shared, ConeProjector(grid, geometry)(volume)


def test_rows_of_pixels_that_share_a_height_blur_the_outermost_rows_alone(monkeypatch):
    shared, exact = shared_and_exact(monkeypatch, "BENT", 113)
    assert not torch.equal(shared, exact)
    assert float((shared - exact).abs().max()) < 0.1 * float(exact.max())
    assert math.isclose(float(shared.sum()), float(exact.sum()), rel_tol=1e-4)


def test_cells_that_share_a_height_differ_by_a_few_percent_of_a_thin_disc(monkeypatch):
    shared, exact = shared_and_exact(monkeypatch, "ASIDE", 452)
    difference = (shared - exact).abs().max() / exact.max()
    assert 1e-6 < float(difference) < 0.03
    assert math.isclose(float(shared.sum()), float(exact.sum()), rel_tol=1e-5)
