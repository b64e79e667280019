import json
import math
import re

import numpy as np
import pytest

from pnpct.files import FileFormatError, read_geometry
from pnpct.geometry import FanBeam, evenly_spaced_views

LENGTHS = {
    "source_to_isocenter_mm": 541.0,
    "source_to_detector_mm": 949.0,
    "bins": 5,
    "bin_width_mm": 1.0239,
}
CATSIM = {
    "sid_mm": 541.0,
    "sdd_mm": 949.0,
    "n_cols": 900,
    "col_pitch_mm": 1.0239,
    "col_offset_cols": 0.25,
    "n_views": 3,
    "views_per_rotation": 4,
    "start_angle_deg": 30.0,
    "rotation_direction": -1,
}


def test_all_keys_reach_the_geometry():
    written = read_geometry(
        {
            **LENGTHS,
            "comment": "two views, by hand",
            "view_angles_rad": [0.25, -1],
            "detector": "flat",
            "detector_offset_bins": -1.25,
            "focal_spot_shifts_mm": [[0.5, 0], [-0.5, 0.1]],
        }
    )
    assert not written.bins_reversed
    assert written.geometry == FanBeam(
        view_angles=(0.25, -1.0),
        bins=5,
        source_to_isocenter=541.0,
        source_to_detector=949.0,
        bin_width=1.0239,
        detector_offset=-1.25,
        detector="flat",
        focal_spot_shifts=((0.5, 0.0), (-0.5, 0.1)),
    )


def test_the_defaults_are_a_full_turn_from_the_top():
    written = read_geometry({**LENGTHS, "views": 8})
    assert written.geometry == FanBeam(evenly_spaced_views(8), 5, 541.0, 949.0, 1.0239)
    assert not written.bins_reversed


def test_a_part_of_a_turn_may_run_clockwise():
    counter = read_geometry({**LENGTHS, "views": 4, "start_deg": 10, "span_deg": 200}).geometry
    assert np.degrees(counter.view_angles) == pytest.approx([10, 60, 110, 160])
    clockwise = read_geometry({**LENGTHS, "views": 4, "start_deg": 10, "span_deg": -200}).geometry
    assert np.degrees(clockwise.view_angles) == pytest.approx([10, -40, -90, -140])


def test_the_angles_may_stand_in_a_file_beside_the_json(tmp_path):
    np.savez(tmp_path / "scan.npz", counts=np.ones((3, 5)), angles=np.array([0, 90, 180], np.float32))
    (tmp_path / "geometry.json").write_text(json.dumps({**LENGTHS, "view_angles_deg": "scan.npz:angles"}))
    geometry = read_geometry(tmp_path / "geometry.json").geometry
    assert geometry.view_angles == pytest.approx([0.0, math.pi / 2, math.pi])


@pytest.mark.parametrize(
    ("where", "at_zero", "at_ninety"),
    [
        ("+y", (0, 541), (-541, 0)),
        ("+x", (541, 0), (0, 541)),
        ("-y", (0, -541), (541, 0)),
        ("-x", (-541, 0), (0, -541)),
    ],
)
def test_the_source_starts_where_it_is_said_to(where, at_zero, at_ninety):
    angles = {"view_angles_deg": [0, 90], "source_at_zero_angle": where}
    spots = read_geometry({**LENGTHS, **angles}).geometry.focal_spots()
    np.testing.assert_allclose(spots, [at_zero, at_ninety], atol=1e-9)
    turned = read_geometry({**LENGTHS, **angles, "rotation_direction": -1}).geometry.focal_spots()
    np.testing.assert_allclose(turned[0], at_zero, atol=1e-9)
    np.testing.assert_allclose(turned[1], np.negative(at_ninety), atol=1e-9)


def test_the_bins_may_run_the_other_way():
    assert read_geometry({**LENGTHS, "views": 8, "bin_direction": -1}).bins_reversed


def test_the_keys_of_catsim_are_understood_beside_notes():
    written = read_geometry({**CATSIM, "kVp": 120, "detector": "equi-angular arc centred on the source"})
    geometry = written.geometry
    assert np.degrees(geometry.view_angles) == pytest.approx([30.0, -60.0, -150.0])
    assert (geometry.shape, geometry.detector, geometry.detector_offset) == ((3, 900), "arc", 0.25)
    assert not written.bins_reversed


def test_the_chest_scan_has_the_fan_angles_that_its_file_says(shared_data):
    path = shared_data / "catsim" / "chest" / "geometry.json"
    content = json.loads(path.read_text())
    geometry = read_geometry(path).geometry
    assert geometry.fan_angles[0] == pytest.approx(content["gamma0_rad"], abs=1e-12)
    assert np.diff(geometry.fan_angles) == pytest.approx(content["d_gamma_rad"], abs=1e-12)
    assert geometry.view_angles == pytest.approx(2 * np.pi * np.arange(984) / 984)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"bin_width": 1.0}, "unknown keys: bin_width; known are bin_direction, bin_width_mm, bins"),
        ({"SID": 1, "fov": 2}, "unknown keys: SID, fov;"),
        ({"bins": None}, "missing keys: bins; add them."),
        ({"bins": None, "bin_width_mm": None}, "missing keys: bin_width_mm, bins; add them."),
        ({"views": None}, "one of view_angles_deg, view_angles_rad, views is needed, got none"),
        ({"view_angles_rad": [0]}, "got view_angles_rad and views"),
        (
            {"views": None, "view_angles_deg": [0], "span_deg": 1},
            "span_deg go with views, not with view_angles_deg",
        ),
        (
            {"views": None, "view_angles_deg": 3},
            "view_angles_deg must be a list of angles or the name of a file, got 3",
        ),
        ({"views": None, "view_angles_deg": []}, "at least one view"),
        ({"views": None, "view_angles_deg": [0, "90"]}, "view_angles_deg must be a finite number, got '90'"),
        ({"views": 100_000_000}, "at most 1000000 views, got 100000000"),
        ({"views": 10**18}, "at most 1000000 views"),
        ({"bins": 10**18}, "at most 1000000 bins and rows"),
        ({"detector": "m" * 100_000}, "detector must be one of arc, flat, got 'mmmmmm"),
        ({"views": None, "view_angles_rad": "../angles.npy"}, "it names '../angles.npy', which is not in its own"),
        ({"views": None, "view_angles_rad": "/etc/angles.npy"}, "it names '/etc/angles.npy', which is not in its own"),
        ({"views": 2.5}, "views must be a whole number of at least 1, got 2.5"),
        ({"bins": 0}, "bins must be a whole number of at least 1, got 0"),
        ({"bins": True}, "bins must be a finite number, got True"),
        ({"bin_width_mm": "1 mm"}, "bin_width_mm must be a finite number, got '1 mm'"),
        ({"bin_width_mm": float("nan")}, "bin_width_mm must be a finite number, got nan"),
        ({"bin_width_mm": 10**400}, "bin_width_mm must be a finite number"),
        ({"bin_width_mm": -1}, "bin_width must be a positive length in mm, got -1.0"),
        ({"source_to_detector_mm": 500}, "The detector must lie beyond the isocentre"),
        ({"detector": "curved"}, "detector must be one of arc, flat, got 'curved'"),
        ({"bin_direction": 0}, "bin_direction must be one of 1, -1, got 0"),
        ({"source_at_zero_angle": "top"}, "source_at_zero_angle must be one of +y, -x, -y, +x, got 'top'"),
        ({"rotation_direction": True}, "rotation_direction must be one of 1, -1, got True"),
        (
            {"focal_spot_shifts_mm": [1, 2]},
            "focal_spot_shifts_mm must be a list with [along, away] for each view",
        ),
        ({"focal_spot_shifts_mm": [[0, 0]]}, "Focal-spot shifts are one per view: 3 views, got 1 shifts"),
    ],
)
def test_what_does_not_fit_is_one_sentence_that_names_the_file(tmp_path, change, message):
    content = {**LENGTHS, "views": 3} | change
    path = tmp_path / "geometry.json"
    path.write_text(json.dumps({key: value for key, value in content.items() if value is not None}))
    with pytest.raises(FileFormatError, match=f"^{path}: .*{re.escape(message)}") as raised:
        read_geometry(path)
    assert len(str(raised.value)) < 700


def test_catsim_has_no_more_views_than_any_scan():
    with pytest.raises(FileFormatError, match="at most 1000000 views"):
        read_geometry({**CATSIM, "n_views": 1e18})


@pytest.mark.parametrize("key", sorted(CATSIM.keys() - {"sid_mm"}))
def test_no_key_of_catsim_may_be_missing(key):
    with pytest.raises(FileFormatError, match=f"missing keys: {key}"):
        read_geometry({name: value for name, value in CATSIM.items() if name != key})


def test_a_flat_detector_is_none_of_catsims():
    with pytest.raises(FileFormatError, match="must be an equi-angular arc, got 'flat panel'"):
        read_geometry({**CATSIM, "detector": "flat panel"})


@pytest.mark.parametrize("text", ["{", "", "[" * 100_000, '{"bins": 1' + "0" * 5000 + "}", "\xff"])
def test_what_is_not_json_is_one_sentence(tmp_path, text):
    path = tmp_path / "geometry.json"
    path.write_text(text, encoding="latin-1")
    with pytest.raises(FileFormatError, match=f"^{path}: this is not JSON"):
        read_geometry(path)


def test_a_list_is_no_geometry(tmp_path):
    path = tmp_path / "geometry.json"
    path.write_text("[1, 2]")
    with pytest.raises(FileFormatError, match="a JSON object with named values was needed"):
        read_geometry(path)
