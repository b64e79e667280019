"""MATLAB files of both kinds, and the scans of HelTomo, as the Helsinki Tomography Challenge gives them."""

import h5py
import numpy as np
import pytest
from mat_files import of_version_5, of_version_7_3
from scipy.io import savemat

from pnpct.files import FileFormatError, load_array, read_geometry, scan_from_arrays

VIEWS, BINS = 5, 8
ANGLES = np.arange(30.0, 32.5, 0.5)
SINOGRAM = np.random.default_rng(3).uniform(0, 2, (VIEWS, BINS))
PARAMETERS = {
    "projectName": "disc",
    "distanceSourceOrigin": 410.66,
    "distanceSourceDetector": 553.74,
    "geometricMagnification": 1.3484,
    "numDetectorsPost": BINS,
    "pixelSizePost": 12.5,
    "freeRayAtDetector": [1, 128, 1, 128],
    "angles": ANGLES,
}
SAME = {
    "source_to_isocenter_mm": 410.66,
    "source_to_detector_mm": 553.74,
    "bins": BINS,
    "bin_width_mm": 12.5,
    "detector": "flat",
    "view_angles_deg": ANGLES.tolist(),
    "source_at_zero_angle": "-y",
    "bin_direction": -1,
}


@pytest.fixture(params=[of_version_5, of_version_7_3])
def path(request, tmp_path):
    request.param(tmp_path / "scan.mat", SINOGRAM, PARAMETERS)
    return tmp_path / "scan.mat"


def test_arrays_have_matlabs_shapes_and_names(path):
    assert np.array_equal(load_array(path), SINOGRAM)
    assert np.array_equal(load_array(f"{path}:CtDataLimited.sinogram"), SINOGRAM)
    assert load_array(f"{path}:CtDataLimited.parameters.angles").shape == (1, VIEWS)
    with pytest.raises(FileFormatError, match=r"has no array sino; it has CtDataLimited\.\S*,"):
        load_array(f"{path}:sino")


@pytest.mark.parametrize("odd", [np.zeros((3, 3)), h5py.Empty("f4"), "char"])
def test_another_word_for_the_class_does_not_matter(tmp_path, odd):
    of_version_7_3(tmp_path / "scan.mat", SINOGRAM, PARAMETERS)
    with h5py.File(tmp_path / "scan.mat", "r+") as file:
        file["CtDataLimited/sinogram"].attrs["MATLAB_class"] = odd
    assert np.array_equal(load_array(tmp_path / "scan.mat"), SINOGRAM)


def test_the_file_is_its_own_geometry(path):
    ours, theirs = read_geometry(SAME), read_geometry(path)
    assert theirs.bins_reversed
    assert np.allclose(theirs.geometry.focal_spots(), ours.geometry.focal_spots())
    there, here = (each.geometry.detector_points(each.geometry.fan_angles) for each in (theirs, ours))
    assert np.allclose(there, here)
    scan = scan_from_arrays(path, path, incident=1e5)
    assert np.allclose(scan.counts, 1e5 * np.exp(-SINOGRAM[:, ::-1]))


def test_a_file_that_says_too_little_is_refused(tmp_path):
    known = {key: PARAMETERS[key] for key in PARAMETERS if key != "numDetectorsPost"}
    of_version_5(tmp_path / "cone.mat", SINOGRAM, known)
    with pytest.raises(FileFormatError, match=r"cone.mat: a fan beam of HelTomo needs numDetectorsPost"):
        read_geometry(tmp_path / "cone.mat")
    savemat(tmp_path / "plain.mat", {"sinogram": SINOGRAM})
    with pytest.raises(FileFormatError, match="no structure in it has parameters of a scan"):
        read_geometry(tmp_path / "plain.mat")


def test_a_cut_file_and_one_that_leads_elsewhere_are_refused(path):
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    with pytest.raises(FileFormatError, match=r"not a complete MATLAB file|truncated"):
        load_array(path)
    with h5py.File(path, "w") as file:
        file["sinogram"] = h5py.ExternalLink("/etc/passwd", "/x")
    with pytest.raises(FileFormatError, match="a link to another file"):
        load_array(path)
