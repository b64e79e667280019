import math

import nibabel as nib
import numpy as np
import pytest
import torch

from pnpct.files import FileFormatError, Provenance, import_arrays, read_image, write_image
from pnpct.files.plausible import doubt_of_image, doubt_of_object
from pnpct.geometry import ImageGrid
from pnpct.units import from_hu

TURN = {"source_to_isocenter_mm": 570, "source_to_detector_mm": 1040, "bins": 8, "bin_width_mm": 60, "views": 12}


def geometry(scale=1.0, **changes):
    lengths = {key: scale * value if key.endswith("_mm") else value for key, value in TURN.items()}
    return {key: value for key, value in (lengths | changes).items() if value is not None}


UNUSUAL = [
    (geometry(1e-3), "a length of 0.57 mm, where 1 to 20000 mm are usual: is it in m?"),
    (geometry(focal_spot_shifts_mm=[[600, 0], [-600, 0]] * 6), "a focal spot shifted by 600 mm, .* is it in µm?"),
    (geometry(1e6), "a length of 5.7e.08 mm, .* is it in µm or nm?"),
    (geometry(view_angles_rad=list(range(0, 360, 30)), views=None), "view angles over 52.5 turns: are they degrees"),
    (
        geometry(view_angles_deg=[math.radians(30 * view) for view in range(12)], views=None),
        "view angles over 5.76 degrees: are they rad",
    ),
]


@pytest.mark.parametrize(("written", "message"), UNUSUAL)
def test_a_geometry_in_another_unit_is_doubted_with_the_likely_mistake(written, message):
    with pytest.raises(ValueError, match=f"This scan has {message}.*If it is meant, insist"):
        import_arrays(np.zeros((12, 8)), written)
    assert import_arrays(np.zeros((12, 8)), written, insist=True).scan.geometry.shape == (12, 8)


@pytest.mark.parametrize("written", [geometry(), geometry(0.02), geometry(span_deg=720), geometry(span_deg=20)])
def test_small_scanners_two_turns_and_short_arcs_are_usual(written):
    assert import_arrays(np.zeros((12, 8)), written).scan.geometry.shape == (12, 8)


def test_a_number_that_no_detector_counts_is_refused():
    with pytest.raises(ValueError, match=r"counts of up to 1e\+18, got 1e\+300"):
        import_arrays(np.full((12, 8), 1e300), geometry(), kind="counts", incident=1e5)


@pytest.mark.parametrize(
    ("array", "options", "message"),
    [
        (np.ones((12, 8)), {"mu_water": 0.19}, "mu_water = 0.19/mm, .*: is it in 1/cm"),
        (np.full((12, 8), -2.0), {"incident": 1e5}, "3 times the incident counts in 100% of its rays: .* wrong sign"),
        (np.full((12, 8), 1e4), {"kind": "counts", "incident": 100.0}, "are these of another exposure"),
    ],
)
def test_numbers_that_no_scan_has_are_doubted_with_the_likely_mistake(array, options, message):
    with pytest.raises(ValueError, match=message):
        import_arrays(array, geometry(), **options)
    assert import_arrays(array, geometry(), insist=True, **options).scan.counts.shape == (12, 8)


def test_noise_of_a_starved_scan_is_not_doubted():
    counts = np.random.default_rng(0).poisson(2.0, (12, 8))
    assert import_arrays(counts, geometry(), kind="counts", incident=2.0).scan.counts.sum() == counts.sum()


@pytest.mark.parametrize(
    ("low", "high", "message"),
    [
        (0.0, 1.0, "HU were needed, where air is -1000, but the values go from 0 to 1; are they in another unit"),
        (-1000.0, 1e8, r"values from -1000 to 1e\+08 are no HU; is the file damaged"),
    ],
)
def test_values_that_are_no_hu_are_refused(tmp_path, low, high, message):
    nib.save(
        nib.Nifti1Image(np.linspace(low, high, 64, dtype=np.float32).reshape(4, 4, 4), np.eye(4)), tmp_path / "a.nii"
    )
    with pytest.raises(FileFormatError, match=message):
        read_image(tmp_path / "a.nii")


def test_voxels_that_no_memory_holds_are_those_of_a_damaged_file(tmp_path):
    header = nib.Nifti1Header()
    header.set_data_dtype(np.int16)
    header.set_data_shape((30_000, 30_000, 30_000))
    (tmp_path / "a.nii").write_bytes(header.binaryblock + bytes(1004))
    with pytest.raises(FileFormatError, match=r"declares more voxels than the memory holds|not a complete NIfTI file"):
        read_image(tmp_path / "a.nii")


def test_lengths_of_nifti_are_in_the_unit_that_it_says(tmp_path):
    hu = np.linspace(-1000, 1000, 64, dtype=np.float32).reshape(4, 4, 4)
    for unit, spacing in (("meter", 2e-3), ("mm", 2.0), ("micron", 2e3), ("unknown", 2.0)):
        nifti = nib.Nifti1Image(hu, np.diag([spacing, spacing, spacing, 1.0]))
        nifti.header.set_xyzt_units(xyz=unit)
        nib.save(nifti, tmp_path / "a.nii")
        assert read_image(tmp_path / "a.nii")[1].plane.spacing == pytest.approx(2.0)
    nib.save(nib.Nifti1Image(hu, np.diag([2e-3, 2e-3, 2e-3, 1.0])), tmp_path / "a.nii")
    with pytest.raises(FileFormatError, match=r"an image of 0.008 mm, .*: are the distances of its pixels in m"):
        read_image(tmp_path / "a.nii")


@pytest.mark.parametrize("centimetres", [False, True])
def test_a_body_of_metal_in_a_scan_of_water_is_doubted(centimetres):
    """Ten times the lengths are ten times the HU."""
    written = geometry(0.1 if centimetres else 1.0, bins=100, bin_width_mm=0.5 if centimetres else 5.0)
    p = np.tile(0.02 * 200 * np.sin(np.linspace(0, np.pi, 100)), (12, 1))
    if not centimetres:
        assert import_arrays(p, written).scan.geometry.bins == 100
        return
    with pytest.raises(ValueError, match=r"filled with 7.* times the attenuation of water: are the lengths in cm"):
        import_arrays(p, written)


def test_water_alone_is_read_from_our_own_file(tmp_path):
    write_image(tmp_path / "a.nii", torch.ones(4, 4), ImageGrid(4, 4, spacing=1.0), provenance=Provenance([], "0"))
    assert read_image(tmp_path / "a.nii")[0].tolist() == torch.ones(4, 4).tolist()


@pytest.mark.parametrize("suffix", [".h5", ".nii", ".png"])
def test_an_image_that_has_diverged_is_not_written(tmp_path, suffix):
    with pytest.raises(ValueError, match=r"the image holds 1e\+303 HU, more than any matter has"):
        write_image(
            tmp_path / f"a{suffix}", torch.full((4, 4), 1e300, dtype=torch.float64), ImageGrid(4, 4, spacing=1.0)
        )
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("low", "high", "message"),
    [
        (-1000, 1500, ""),
        (-1024, 30_000, ""),  # metal
        (-150, 150, ""),  # a patch of soft tissue
        (20, 90, ""),
        (0, 1, "are they of another unit, such as 1/cm or 0 to 1"),
        (24, 2500, "are they stored values, without the intercept of -1024"),
        (-1_001_000, 499_000, "are they HU that were taken for attenuation relative to water"),
    ],
)
def test_an_image_that_looks_like_another_unit_is_doubted_with_the_likely_mistake(low, high, message):
    doubt = doubt_of_image(from_hu(torch.linspace(low, high, 64).reshape(8, 8)))
    assert message in doubt
    assert bool(message) == bool(doubt)


@pytest.mark.parametrize(("factor", "doubted"), [(1.0, False), (0.8, False), (1 / np.log(10), True), (0.1, True)])
@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_an_object_unlike_water_is_said_to_be_so(factor, doubted, noise, generator):
    """Line integrals to the base 10 made water -566 HU without a word."""
    image = torch.zeros(64, 64)
    image[10:50, 15:50] = factor
    image[20:25, 20:30] = 2 * factor
    doubt = doubt_of_object(image + noise * factor * torch.randn(64, 64, generator=generator))
    assert ("those to the base 10 times 2.303" in doubt) == doubted
    assert not doubt_of_object(torch.zeros(64, 64))
