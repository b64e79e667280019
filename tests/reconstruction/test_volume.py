import math
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
import torch
from ellipsoid_chords import MU_WATER, chords

from pnpct.denoisers import TotalVariation
from pnpct.geometry import ConeBeam, Detector, ImageGrid, Plane, TiltedPlanes, Trajectory, VolumeGrid
from pnpct.physics import DiagonalWeights, Sinogram
from pnpct.reconstruction import FBP, PlugAndPlay, covered_slices, reconstruct_volume
from pnpct.reconstruction.volume import _at

FEED = 20.0
TURN = 2 * math.pi
ANGLES = TURN / 120 * np.arange(300)
DETECTOR = Detector(bins=100, bin_width=6.0, offset=0.25, rows=16, row_height=2.2)
HELIX = ConeBeam(Trajectory(ANGLES, z=FEED * ANGLES / TURN - 25.0), DETECTOR, 541.0, 949.0)
CIRCLE = replace(HELIX, trajectory=Trajectory(TURN / 120 * np.arange(120), z=[3.0] * 120))
FLYING = [(0.4 * (view % 2) - 0.2, 5.45 * (view % 2), -0.66 * (view % 2)) for view in range(300)]
SCANS = {
    "helix": HELIX,
    "circle": CIRCLE,
    "flying focal spot": replace(HELIX, trajectory=replace(HELIX.trajectory, focal_spot_shifts=FLYING)),
}
PLANE = ImageGrid(48, 48, spacing=5.0)
STACK = VolumeGrid(PLANE, slices=5, slice_spacing=1.25, z=0.5)
BODY = ((0.0, 0.0, 0.0), (90.0, 70.0, 1e6), 1.0)
BALL = ((50.0, 10.0, 0.5), (15.0, 15.0, 6.0), 1.0)


def rays_of(line_integrals: torch.Tensor):
    def rays(views) -> Sinogram:
        values = line_integrals[..., list(views), :, :]
        return Sinogram(values, DiagonalWeights(torch.ones(values.shape[-3:]), tuple(values.shape[-3:])))

    return rays


def volume_of(line_integrals: torch.Tensor, geometry: ConeBeam, grid: VolumeGrid = STACK, **options) -> torch.Tensor:
    slabs = reconstruct_volume(rays_of(line_integrals), geometry, grid, FBP(), mu_water=MU_WATER, **options)
    return torch.cat([slab.image for slab in slabs], dim=-3)


def disc(center, radius: float) -> np.ndarray:
    return np.hypot(PLANE.x[None] - center[0], PLANE.y[:, None] - center[1]) < radius


@pytest.fixture(scope="module")
def helix_rays() -> torch.Tensor:
    return chords(HELIX, BODY, BALL)


@pytest.mark.parametrize("name", SCANS)
def test_what_is_the_same_in_all_slices_is_what_it_is(name):
    geometry = SCANS[name]
    volume = volume_of(chords(geometry, BODY), geometry)
    assert volume.shape == STACK.shape
    for image in volume.numpy():
        assert np.abs(image[disc((0, 0), 60.0)] - 1).max() < 0.02
        assert np.abs(image[~disc((0, 0), 105.0) & disc((0, 0), 118.0)]).max() < 0.05


def test_a_coin_far_from_the_axis_lies_flat_at_its_height_where_horizontal_slices_smear_it():
    coin = ((85.0, 20.0, 0.5), (20.0, 20.0, 1.0), 1.0)
    rays, grid = chords(HELIX, coin), VolumeGrid(PLANE, slices=17, slice_spacing=0.5, z=0.5)
    inside, heights = disc(coin[0], 8.0), grid.heights - 0.5
    peaks = {}
    for rebinning in ("tilted", "single-slice"):
        profile = volume_of(rays, HELIX, grid, rebinning=rebinning).numpy()[:, inside].mean(1)
        peaks[rebinning] = profile.max()
        if rebinning == "tilted":
            assert (profile * heights).sum() / profile.sum() == pytest.approx(0.0, abs=0.1)
            assert np.sum(profile > profile.max() / 2) * 0.5 < 3.0
    assert peaks["tilted"] > 1.2 * peaks["single-slice"]


OTHER_SCANNERS = {
    "turning back": replace(HELIX, trajectory=Trajectory(-ANGLES, z=HELIX.trajectory.z)),
    "falling": replace(HELIX, trajectory=Trajectory(ANGLES + 2.0, z=-HELIX.trajectory.heights)),
    "both": replace(HELIX, trajectory=Trajectory(-ANGLES, z=-HELIX.trajectory.heights)),
    "a pitch of 1.3": replace(HELIX, trajectory=Trajectory(ANGLES, z=1.3 * HELIX.trajectory.heights)),
    "rows and bins aside": replace(HELIX, detector=replace(DETECTOR, offset=-6.25, row_offset=1.75)),
    "flat": replace(HELIX, detector=replace(DETECTOR, kind="flat", row_offset=0.25)),
    "flying focal spot": replace(HELIX, trajectory=replace(HELIX.trajectory, focal_spot_shifts=FLYING)),
    "axial": replace(CIRCLE, detector=replace(DETECTOR, row_offset=-1.25)),
}


@pytest.mark.parametrize("name", OTHER_SCANNERS)
def test_a_ball_is_where_it_is_however_the_scanner_turns(name):
    geometry, (center, axes) = OTHER_SCANNERS[name], ((55.0, -40.0, 1.5), (8.0, 8.0, 5.0))
    grid = VolumeGrid(ImageGrid(20, 20, spacing=2.0, center=(54.0, -41.0)), slices=17, slice_spacing=1.0, z=1.0)
    image = volume_of(chords(geometry, (center, axes, 1.0)), geometry, grid).double().numpy()
    z, y, x = np.meshgrid(grid.heights, grid.plane.y, grid.plane.x, indexing="ij")
    assert [(image * along).sum() / image.sum() for along in (x, y, z)] == pytest.approx(center, abs=0.1)


def test_slices_do_not_depend_on_where_one_begins_or_on_the_slab(helix_rays):
    whole = volume_of(helix_rays, HELIX)
    slabs = list(reconstruct_volume(rays_of(helix_rays), HELIX, STACK, FBP(), mu_water=MU_WATER, first=1, slab=3))
    assert [(slab.first, slab.image.shape[-3]) for slab in slabs] == [(1, 3), (4, 1)]
    assert torch.equal(torch.cat([slab.image for slab in slabs], dim=-3), whole[1:])
    circle = chords(CIRCLE, BODY, BALL)
    low = replace(STACK, z=3.0)
    assert torch.equal(volume_of(circle, CIRCLE, low, first=2), volume_of(circle, CIRCLE, low)[2:])


@pytest.mark.parametrize(("planes", "degree"), [(7, 3), (4, 3), (3, 2), (2, 1), (1, 0)])
def test_between_planes_is_the_cubic_or_what_fewer_planes_allow(planes, degree):
    points = np.meshgrid(PLANE.x, PLANE.y)
    tilted = [Plane(0.4 * z, slope=(0.004 * math.cos(0.3 * z), 0.004 * math.sin(0.3 * z))) for z in range(planes)]
    images = [torch.from_numpy((plane.heights(*points) - 1.1) ** degree) for plane in tilted]
    low, high = tilted[0].heights(*points), tilted[-1].heights(*points)
    for height in (0.3, 1.15, 1.4):
        made = _at(height, list(zip(tilted, images, strict=True)), PLANE).numpy()
        np.testing.assert_allclose(made, (np.clip(height, low, high) - 1.1) ** degree, atol=1e-9)


def test_a_batch_of_scans_is_each_of_them(helix_rays):
    both = volume_of(torch.stack([helix_rays, 0.5 * helix_rays]), HELIX, replace(STACK, slices=2))
    assert both.shape == (2, 2, 48, 48)
    torch.testing.assert_close(both[1], 0.5 * both[0], rtol=1e-4, atol=1e-5)


def test_a_thick_slice_is_the_mean_of_thin_ones(helix_rays):
    thick = volume_of(helix_rays, HELIX, VolumeGrid(PLANE, 1, 4.0, z=0.5), thickness=4.0, plane_spacing=0.6)
    thin = volume_of(helix_rays, HELIX, VolumeGrid(PLANE, 7, 4.0 / 7, z=0.5), plane_spacing=0.6)
    torch.testing.assert_close(thick[0], thin.mean(0), rtol=0, atol=1e-5)


def test_thin_slices_of_a_circle_are_planes_of_their_own():
    line_integrals = chords(CIRCLE, BODY, BALL)
    heights = replace(STACK, z=3.0)
    some = volume_of(line_integrals, CIRCLE, heights)
    one = volume_of(line_integrals, CIRCLE, VolumeGrid(PLANE, 1, 1.25, z=heights.heights[3]))
    torch.testing.assert_close(some[3], one[0], rtol=0, atol=1e-5)


def test_every_view_is_asked_for_once_and_a_method_sees_the_planes_of_a_window(helix_rays):
    asked: Counter = Counter()
    batches = []

    def rays(views) -> Sinogram:
        asked.update(views)
        return rays_of(helix_rays)(views)

    class Counting(FBP):
        def __call__(self, sinogram, A, **options):
            batches.append(sinogram.line_integrals.shape[0])
            return super().__call__(sinogram, A, **options)

    list(reconstruct_volume(rays, HELIX, STACK, Counting(), mu_water=MU_WATER))
    assert set(asked.values()) == {1}
    assert set(batches) == {2}  # 1.25 mm a window, 1.25 mm a row


def test_iterative_methods_do_without_the_rays_beside_the_detector(helix_rays):
    fewer = replace(HELIX, detector=replace(DETECTOR, rows=10))
    method = PlugAndPlay(TotalVariation(0.02), iterations=4)
    line_integrals = helix_rays[:, 3:13]
    images = [
        slab.image
        for slab in reconstruct_volume(
            rays_of(line_integrals), fewer, replace(STACK, slices=1), method, mu_water=MU_WATER
        )
    ]
    assert np.abs(images[0][0].numpy()[disc((-20, 0), 30.0)] - 1).mean() < 0.02


def test_what_a_scan_covers():
    low, high = covered_slices(TiltedPlanes(HELIX), PLANE)
    assert -25.0 < low < -14.0
    assert 14.0 < high < 25.0
    beyond = replace(STACK, z=high)
    with pytest.raises(ValueError, match=r"covers slices from -1\d\.\d+ to 1\d\.\d+ mm, but the volume goes from"):
        next(reconstruct_volume(rays_of(torch.zeros(HELIX.shape)), HELIX, beyond, FBP(), mu_water=MU_WATER))
    with pytest.raises(ValueError, match="No slice of 60 mm is covered"):
        covered_slices(TiltedPlanes(HELIX), PLANE, 60.0)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"thickness": -1.0}, "from 0 up, got -1"),
        ({"slab": 0}, "at least one slice, got 0"),
        ({"plane_spacing": 0.0}, "positive length in mm, got 0"),
    ],
)
def test_options_out_of_range(options, words):
    with pytest.raises(ValueError, match=words):
        volume_of(torch.zeros(HELIX.shape), HELIX, **options)
