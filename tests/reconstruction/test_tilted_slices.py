import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from pnpct.geometry import ConeBeam, Detector, TiltedPlanes, Trajectory
from pnpct.physics import BoneHardening, DiagonalWeights, Sinogram
from pnpct.reconstruction.tilted_slices import rebin

ANGLES = 2 * math.pi / 90 * np.arange(180)
DETECTOR = Detector(bins=50, bin_width=18.0, offset=0.25, rows=14, row_height=1.5, row_offset=0.3)
HELIX = ConeBeam(Trajectory(ANGLES, z=20 * ANGLES / 2 / math.pi), DETECTOR, 541.0, 949.0)
FLYING = [(0.4 * (view % 2) - 0.2, 5.4 * (view % 2), -0.66 * (view % 2)) for view in range(180)]
HELICES = {
    "arc": HELIX,
    "flat": replace(HELIX, detector=replace(DETECTOR, kind="flat")),
    "flying focal spot": replace(HELIX, trajectory=replace(HELIX.trajectory, focal_spot_shifts=FLYING)),
}


def lines(cone: ConeBeam) -> tuple[np.ndarray, np.ndarray]:
    """Focal spots (views, 1, 1, 3), and vectors from there to the cells (views, rows, bins, 3)."""
    spots = cone.focal_spots()[:, None, None]
    cells = np.repeat(cone.detector_points(cone.fan_angles)[:, None], cone.rows, axis=1)
    cells[..., 2] += cone.detector.row_positions[:, None]
    return spots, cells - spots


def distances(apart: np.ndarray, along: np.ndarray) -> np.ndarray:
    """Signed distances of a point from lines in a plane."""
    return (apart[..., 0] * along[..., 1] - apart[..., 1] * along[..., 0]) / np.linalg.norm(along, axis=-1)


def of(values: np.ndarray, cone: ConeBeam, weights: np.ndarray | float = 1.0) -> Sinogram:
    diagonal = torch.from_numpy(np.broadcast_to(weights, cone.shape).astype(np.float32).copy())
    return Sinogram(torch.from_numpy(values.astype(np.float32)), DiagonalWeights(diagonal, cone.shape))


@pytest.mark.parametrize("name", HELICES)
def test_a_cylinder_has_in_each_plane_the_chords_of_a_disc(name):
    geometry = HELICES[name]
    planes = TiltedPlanes(geometry)
    stack = planes.stack_at(20.0)
    views = planes.views(stack)
    cone, fan, center, radius = geometry[views], planes.fan(views), np.array([40.0, -30.0]), 90.0
    spots, towards = lines(cone)
    in_plane = np.linalg.norm(towards[..., :2], axis=-1)
    aside = distances(center - spots[..., :2], towards[..., :2])
    chords = 2 * np.sqrt(np.maximum(radius**2 - aside**2, 0)) * np.linalg.norm(towards, axis=-1) / in_plane
    flat_spots = fan.focal_spots()[:, None]
    flat = fan.detector_points(fan.fan_angles) - flat_spots
    aside = distances(center - flat_spots, flat)
    rebinned = rebin(of(chords, cone), cone, stack.planes)
    exact = 2 * np.sqrt(np.maximum(radius**2 - aside**2, 0))
    near_edge = np.abs(radius - np.abs(aside)) < 0.1  # the fan beam has angles and shifts in whole steps
    np.testing.assert_allclose(rebinned.line_integrals[0][~near_edge], exact[~near_edge], atol=0.05)


@pytest.mark.parametrize("name", HELICES)
def test_each_ray_meets_its_plane_where_it_is_nearest_to_the_axis(name):
    geometry = HELICES[name]
    planes = TiltedPlanes(geometry)
    stack = planes.stack_at(20.0)
    cone = geometry[planes.views(stack)]
    spots, towards = lines(cone)
    nearest = -(spots[..., :2] * towards[..., :2]).sum(-1) / (towards[..., :2] ** 2).sum(-1)
    points = spots + nearest[..., None] * towards
    # Rays that are as long as they are high there, when the rise is taken off again.
    rise = np.linalg.norm(towards, axis=-1) / np.linalg.norm(towards[..., :2], axis=-1)
    rebinned = rebin(of(points[..., 2] * rise, cone), cone, stack.planes)
    wanted = stack.planes[0].heights(points[:, 0, :, 0], points[:, 0, :, 1])
    measured = (wanted > points[:, 0, :, 2]) & (wanted < points[:, -1, :, 2])
    assert 0.8 < measured.mean() < 1.0
    np.testing.assert_allclose(rebinned.line_integrals[0][measured], wanted[measured], atol=2e-3)
    weights = rebinned.weights.diagonal[0]
    assert bool((weights[measured] > 0).all())
    beyond = (wanted < points[:, 0, :, 2] - 0.5) | (wanted > points[:, -1, :, 2] + 0.5)
    assert beyond.any()
    assert not weights[beyond].any()


def test_noise_has_the_weights_of_what_it_was_interpolated_from(generator):
    planes = TiltedPlanes(HELIX)
    stack = planes.stack_at(20.0)
    cone = HELIX[planes.views(stack)]
    deviations = 0.01 + 0.05 * torch.rand(*cone.shape, generator=generator)
    noise = deviations * torch.randn(20, *cone.shape, generator=generator)
    rays = rebin(Sinogram(noise, DiagonalWeights(deviations**-2, cone.shape)), cone, stack.planes)
    assert rays.line_integrals.shape == (20, 1, cone.views, cone.bins)
    assert rays.weights.diagonal.shape == (1, cone.views, cone.bins)
    scores = rays.weights.whiten(rays.line_integrals)[..., rays.weights.diagonal > 0]
    assert float(scores.std()) == pytest.approx(1.0, abs=0.01)


def test_a_row_of_weight_zero_leaves_its_rays_out():
    planes = TiltedPlanes(HELIX)
    stack = planes.stack_at(20.0)
    cone = HELIX[planes.views(stack)]
    weights = np.ones(cone.shape)
    weights[:, 6] = 0.0
    whole = rebin(of(np.ones(cone.shape), cone), cone, stack.planes).weights.diagonal > 0
    less = rebin(of(np.ones(cone.shape), cone, weights), cone, stack.planes).weights.diagonal > 0
    assert bool((less <= whole).all())
    assert 0.05 < 1 - int(less.sum()) / int(whole.sum()) < 0.2


def test_what_rays_lack_behind_bone_stays_with_them() -> None:
    bone = BoneHardening(torch.zeros(1, 6), compact=2.5)
    cone = replace(of(np.ones(HELIX.shape), HELIX), bone=bone)
    (stack, *_) = TiltedPlanes(HELIX).stacks(15.0, 16.0, spacing=1.0)
    assert rebin(cone, HELIX, stack.planes).bone is bone
