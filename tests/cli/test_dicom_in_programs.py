"""Where other programs see a ball in the series that a scan became: Debian's dcm2niix, SimpleITK from PyPI."""

import math
import shutil
import subprocess

import nibabel as nib
import numpy as np
import pytest
import torch
from ct_pd_views import BALL, MU_WATER, chords

from pnpct.cli import main
from pnpct.files import Provenance, write_scan
from pnpct.geometry import ConeBeam, Detector, Trajectory
from pnpct.physics import Scan

pytestmark = pytest.mark.slow

ANGLES = 2 * math.pi / 90 * np.arange(300)
HELIX = ConeBeam(
    Trajectory(-ANGLES, z=75.0 - 40.0 * ANGLES / (2 * math.pi)),  # turning back while the table falls
    Detector(bins=60, bin_width=10.0, offset=0.25, rows=16, row_height=5.0, row_offset=0.25),
    source_to_isocenter=541.0,
    source_to_detector=949.0,
)
WHERE = ["--size=60", "--field-of-view=150", "--center", "10", "-20", "3", "--slices=23", "--slice-spacing=4"]
WORDS = {
    "fbp": ["--method", "fbp"],
    "pnp": ["--method", "pnp", "--denoiser", "tv", "--iterations", "2"],
}


@pytest.fixture(scope="module", params=WORDS)
def series(request, tmp_path_factory):
    """A ball, by each method."""
    folder = tmp_path_factory.mktemp("ball")
    cells = np.repeat(HELIX.detector_points(HELIX.fan_angles)[:, None], HELIX.rows, axis=1)
    cells[..., 2] += HELIX.detector.row_positions[:, None]
    counts = torch.from_numpy(1e5 * np.exp(-MU_WATER * chords(HELIX.focal_spots()[:, None, None], cells))).float()
    scan = Scan(counts, torch.tensor(1e5), 3.0, HELIX, mu_water=MU_WATER)
    write_scan(folder / "scan.h5", scan, provenance=Provenance(["pnpct"], "0.1.0"))
    assert main(["reconstruct", str(folder / "scan.h5"), f"{folder / 'series'}/", *WORDS[request.param], *WHERE]) == 0
    return folder / "series"


def middle(hu, positions):
    """Centroid of what is denser than air, at positions (..., 3)."""
    water = np.clip(np.asarray(hu, dtype=float) + 1000, 0, None) * (np.asarray(hu) > -800)
    return (water[..., None] * positions).sum((0, 1, 2)) / water.sum()


def test_simpleitk_sees_it_to_the_left_and_to_the_back(series):
    sitk = pytest.importorskip("SimpleITK", reason="SimpleITK is not installed")
    reader = sitk.ImageSeriesReader()
    reader.SetFileNames(reader.GetGDCMSeriesFileNames(str(series)))
    volume = reader.Execute()
    indices = np.stack(np.meshgrid(*map(np.arange, volume.GetSize()), indexing="ij"), axis=-1).reshape(-1, 3)
    places = np.array([volume.TransformIndexToPhysicalPoint(index) for index in indices.tolist()])
    hu = sitk.GetArrayFromImage(volume).transpose(2, 1, 0)
    assert middle(hu, places.reshape(*hu.shape, 3)) == pytest.approx((BALL[0], -BALL[1], BALL[2]), abs=0.3)


def test_dcm2niix_sees_it_to_the_left_and_to_the_back(series, tmp_path):
    if shutil.which("dcm2niix") is None:
        pytest.skip("dcm2niix is not installed")
    subprocess.run(["dcm2niix", "-o", tmp_path, "-f", "theirs", series], check=True, capture_output=True)
    image = nib.load(tmp_path / "theirs.nii")
    indices = np.stack(np.meshgrid(*map(np.arange, image.shape), indexing="ij"), axis=-1)
    places = nib.affines.apply_affine(image.affine, indices)
    assert middle(image.get_fdata(), places) == pytest.approx((-BALL[0], BALL[1], BALL[2]), abs=0.3)
