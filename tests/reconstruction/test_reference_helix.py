"""An independent helical scan of a chest, of which the truth is known: what tilted planes lose of it."""

import runpy

import numpy as np
import pytest
import torch
from scipy.ndimage import binary_erosion

from pnpct.geometry import ConeBeam, Detector, ImageGrid, TiltedPlanes, Trajectory, VolumeGrid
from pnpct.physics import DiagonalWeights, Sinogram
from pnpct.reconstruction import FBP, rebin, reconstruct_volume

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def reader(shared_data):
    if not (shared_data / "volumes" / "chest_helical.h5").exists():
        pytest.skip("the helical reference scan is not here; set PNPCT_TEST_DATA to the folder that has volumes/")
    return runpy.run_path(str(shared_data / "volumes" / "read_scan.py"))


@pytest.fixture(scope="module")
def scan(reader, shared_data):
    return reader["read"](shared_data / "volumes" / "chest_helical.h5")


@pytest.fixture(scope="module")
def helix(scan) -> ConeBeam:
    row, column = ([float(scan[f"{name}_{of}"]) for of in ("mm", "offset")] for name in ("row", "column"))
    detector = Detector(int(scan["columns"]), *column, rows=int(scan["rows"]), row_height=row[0], row_offset=row[1])
    return ConeBeam(Trajectory(scan["beta"], scan["z"]), detector, float(scan["sid"]), float(scan["sdd"]))


def test_soft_tissue_and_a_thin_disc_far_from_the_axis(scan, helix):
    def rays(views) -> Sinogram:
        values = torch.from_numpy(scan["mono"][list(views)]).float()
        return Sinogram(values, DiagonalWeights(torch.ones_like(values), tuple(values.shape)))

    plane = ImageGrid(512, 512, spacing=float(scan["truth_pixel_mm"]))
    x, y, z, *_ = scan["modules"][1]
    grid = VolumeGrid(plane, 15, 0.625, float(z))
    slabs = reconstruct_volume(rays, helix, grid, FBP("hann"), mu_water=float(scan["mu_water"]))
    image_hu = torch.cat([slab.image for slab in slabs]).sub(1).mul(1000).numpy()

    profile = image_hu[:, np.hypot(plane.x[None] - x, plane.y[:, None] - y) < 6.0].mean(1)
    profile -= np.median(profile)
    away = grid.heights - z
    fine = np.linspace(-2, 2, 4001)
    width = np.ptp(fine[np.interp(fine, away, profile) > profile.max() / 2])
    assert profile.max() >= 480.0
    assert width <= 1.0
    assert abs((profile * away).sum() / profile.sum()) <= 0.1

    soft = (scan["truth_hu"] > -100) & (scan["truth_hu"] < 150)
    for image, number in zip(image_hu[::7], np.searchsorted(scan["truth_z"], grid.heights[::7] - 0.1), strict=True):
        mask = binary_erosion(soft[number - 2 : number + 3].all(0), iterations=5)
        assert np.sqrt(np.square(image - scan["truth_hu"][number])[mask].mean()) <= 10.5


def test_the_noise_of_rebinned_rays_is_what_their_weights_say(reader, scan, helix):
    planes = TiltedPlanes(helix)
    stack = planes.stack_at(0.2)
    views = planes.views(stack)[::4]
    generator = np.random.default_rng(1)
    noisy = np.stack([reader["line_integrals"](scan, view, 100.0, generator) for view in views]) - scan["clean"][views]
    variance = np.stack([reader["variance"](scan, view, 100.0) for view in views])
    weights = DiagonalWeights(torch.from_numpy(1 / variance).float(), noisy.shape)
    rays = rebin(Sinogram(torch.from_numpy(noisy).float(), weights), helix[views], stack.planes)
    scores = rays.weights.whiten(rays.line_integrals)[rays.weights.diagonal > 0]
    assert float(scores.std()) == pytest.approx(1.0, abs=0.02)
