import json
import re

import numpy as np
import pytest
import torch

from pnpct.files import FileFormatError, load_array, read_scan, scan_from_arrays, write_scan
from pnpct.files.provenance import Provenance
from pnpct.units import MU_WATER_70_KEV

GEOMETRY = {
    "source_to_isocenter_mm": 541.0,
    "source_to_detector_mm": 949.0,
    "bins": 4,
    "bin_width_mm": 1.0,
    "views": 3,
}


@pytest.fixture
def line_integrals():
    return np.random.default_rng(5).uniform(0.0, 6.0, (3, 4))


def test_line_integrals_become_counts_that_give_them_back(line_integrals):
    scan = scan_from_arrays(line_integrals, GEOMETRY, incident=2e5, electronic_noise=3.0)
    expected = torch.from_numpy((2e5 * np.exp(-line_integrals)).astype(np.float32))
    assert torch.equal(scan.counts, expected)
    assert scan.incident == 2e5
    assert (scan.electronic_noise, scan.mu_water) == (3.0, MU_WATER_70_KEV)
    np.testing.assert_allclose(-torch.log(scan.counts / scan.incident), line_integrals, atol=1e-6)


def test_counts_stay_counts(line_integrals):
    counts = 1000.0 * line_integrals - 1.0
    scan = scan_from_arrays(
        counts.astype(np.float32), GEOMETRY, kind="counts", incident=1e4, electronic_noise=1.0, mu_water=0.02
    )
    assert torch.equal(scan.counts, torch.from_numpy(counts.astype(np.float32)))
    assert scan.mu_water == 0.02


def test_whole_numbers_are_counts_too():
    counts = np.arange(1, 13, dtype=np.uint16).reshape(3, 4)
    scan = scan_from_arrays(counts, GEOMETRY, kind="counts", incident=100)
    assert scan.counts.tolist() == counts.tolist()


def test_a_signal_is_divided_into_quanta(line_integrals):
    air = np.array([1e6, 2e6, 2e6, 1e6])
    signal = air * np.exp(-line_integrals)
    scan = scan_from_arrays(signal, GEOMETRY, kind="counts", incident=air, signal_per_quantum=70.0)
    assert scan.incident.tolist() == pytest.approx(air / 70.0)
    np.testing.assert_allclose(-torch.log(scan.counts / scan.incident), line_integrals, atol=1e-6)
    again = scan_from_arrays(line_integrals, GEOMETRY, incident=air, signal_per_quantum=70.0)
    torch.testing.assert_close(again.counts, scan.counts)


def test_a_batch_of_slices_has_one_geometry(line_integrals):
    scan = scan_from_arrays(np.stack([line_integrals, 2 * line_integrals]), GEOMETRY, incident=1e5)
    assert scan.counts.shape == (2, 3, 4)


@pytest.mark.parametrize("shape", [(), (4,), (3, 1), (3, 4)])
def test_turned_bins_turn_all_that_belongs_to_them(line_integrals, shape):
    generator = np.random.default_rng(6)
    incident = generator.uniform(1e4, 1e5, shape)
    hardening = generator.uniform(0.01, 1.0, (4, 3))
    turned = scan_from_arrays(
        line_integrals, {**GEOMETRY, "bin_direction": -1}, incident=incident, beam_hardening=hardening
    )
    straight = scan_from_arrays(
        line_integrals[:, ::-1],
        GEOMETRY,
        incident=incident[..., ::-1] if shape else incident,
        beam_hardening=hardening[::-1],
    )
    assert torch.equal(turned.counts, straight.counts)
    assert torch.equal(turned.incident, straight.incident)
    assert torch.equal(turned.beam_hardening.coefficients, straight.beam_hardening.coefficients)
    assert turned.geometry == straight.geometry


def test_everything_may_come_from_files(tmp_path, line_integrals):
    np.save(tmp_path / "p.npy", line_integrals)
    np.savez(tmp_path / "air.npz", air=np.full(4, 1e5), coefficients=np.ones((4, 2)))
    (tmp_path / "geometry.json").write_text(json.dumps(GEOMETRY))
    scan = scan_from_arrays(
        tmp_path / "p.npy",
        tmp_path / "geometry.json",
        incident=f"{tmp_path}/air.npz:air",
        beam_hardening=f"{tmp_path}/air.npz:coefficients",
    )
    assert torch.equal(scan.counts, scan_from_arrays(line_integrals, GEOMETRY, incident=1e5).counts)
    assert scan.beam_hardening.coefficients.shape == (4, 2)
    write_scan(tmp_path / "scan.h5", scan, provenance=Provenance(["pnpct", "import"], "0"))
    assert torch.equal(read_scan(tmp_path / "scan.h5").counts, scan.counts)


@pytest.mark.parametrize(
    ("array", "options", "message"),
    [
        (
            np.ones((4, 3)),
            {},
            "The array has the shape (4, 3), but the geometry has 3 views and 4 bins; transpose it.",
        ),
        (
            np.ones((3, 5)),
            {},
            "The array has the shape (3, 5), but the geometry has 3 views and 4 bins; correct one",
        ),
        (np.ones(4), {}, "The array has the shape (4,)"),
        (np.full((3, 4), np.inf), {}, "must hold finite real numbers, got float64 of (3, 4)"),
        (np.full((3, 4), np.nan), {}, "No ray was measured"),
        (np.ones((3, 4), complex), {}, "must hold finite real numbers, got complex128"),
        (
            np.full((3, 4), 3e4),
            {},
            "holds values as large as 30000, no line integral; if these are counts, set kind to counts",
        ),
        (np.ones((3, 4)), {"incident": 0.0}, "The incident counts must be positive and finite, or 0 where a ray"),
        (np.ones((3, 4)), {"incident": float("nan")}, "The incident counts must be positive and finite"),
        (np.ones((3, 4)), {"incident": np.ones(3)}, "of the shape (4,), (3, 1) or (3, 4), got (3,)"),
        (
            np.ones((3, 4)),
            {"signal_per_quantum": 0.0},
            "signal_per_quantum must be a positive number, got 0.0",
        ),
        (np.ones((3, 4)), {"electronic_noise": -1.0}, "electronic_noise must be finite and not negative"),
        (np.ones((3, 4)), {"beam_hardening": np.ones((3, 2))}, "for 3 bins, the scan has 4"),
    ],
)
def test_what_does_not_fit_is_one_sentence(array, options, message):
    with pytest.raises(ValueError, match=re.escape(message)) as raised:
        scan_from_arrays(array, GEOMETRY, **{"incident": 1e5, **options})
    assert "\n" not in str(raised.value)


def test_the_only_flat_member_is_the_array(tmp_path):
    np.savez(tmp_path / "scan.npz", p=np.ones((3, 4)), angles=np.zeros(3), meta="words")
    assert load_array(tmp_path / "scan.npz").shape == (3, 4)
    np.savez(tmp_path / "one.npz", angles=np.zeros(3))
    assert load_array(tmp_path / "one.npz").shape == (3,)


@pytest.mark.parametrize(
    ("suffix", "message"),
    [
        ("", "scan.npz holds the arrays a, b, words; choose one, such as .*scan.npz:a"),
        (":c", "scan.npz has no array c; it has a, b, words"),
        (":words", "scan.npz:words: an array of real numbers was needed, got <U2"),
    ],
)
def test_the_member_must_be_clear(tmp_path, suffix, message):
    np.savez(tmp_path / "scan.npz", a=np.ones((3, 4)), b=np.ones((3, 4)), words="no")
    with pytest.raises(FileFormatError, match=message):
        load_array(f"{tmp_path / 'scan.npz'}{suffix}")


def test_a_colon_in_the_name_of_a_file_is_part_of_it(tmp_path):
    np.savez(tmp_path / "a.npz:b.npz", c=np.ones((3, 4)))
    assert load_array(tmp_path / "a.npz:b.npz").shape == (3, 4)
    assert load_array(f"{tmp_path}/a.npz:b.npz:c").shape == (3, 4)


def test_the_first_value_that_is_not_finite_is_named(tmp_path):
    array = np.ones((3, 4))
    array[1, 2] = array[2, 0] = np.inf
    np.save(tmp_path / "p.npy", array)
    with pytest.raises(FileFormatError, match=r"p.npy: 2 values are not finite, the first at \(1, 2\)"):
        load_array(tmp_path / "p.npy")


@pytest.mark.parametrize("name", ["p.npy", "p.npz"])
@pytest.mark.parametrize("kept", [0.0, 0.01, 0.5, 0.99])
def test_truncated_arrays_are_one_sentence(tmp_path, name, kept):
    path = tmp_path / name
    (np.save if name == "p.npy" else np.savez_compressed)(path, np.random.default_rng(0).random((30, 40)))
    content = path.read_bytes()
    path.write_bytes(content[: int(kept * len(content))])
    with pytest.raises(FileFormatError, match=f"^{path}: this is not a complete .npy or .npz file"):
        load_array(path)


def test_pickles_are_not_loaded(tmp_path):
    np.save(tmp_path / "p.npy", np.array([print], dtype=object), allow_pickle=True)
    with pytest.raises(FileFormatError, match=r"this is not a complete \.npy or \.npz file of numbers"):
        load_array(tmp_path / "p.npy")
    with pytest.raises(FileNotFoundError, match="There is no file"):
        load_array(tmp_path / "absent.npz")


def test_the_chest_scan_of_catsim_comes_in_as_it_is(shared_data):
    folder = shared_data / "catsim" / "chest"
    scan = scan_from_arrays(
        folder / "prep_mA40_r0.npz",
        folder / "geometry.json",
        incident=f"{folder}/signal_mean_800mA.npz:air_S1",
        signal_per_quantum=70.0 * 800 / 40,
        electronic_noise=3500.0 / 17.0 / 70.0,
        beam_hardening=folder / "bhc_poly.npz",
    )
    prep = np.load(folder / "prep_mA40_r0.npz")["prep"]
    air = np.load(folder / "signal_mean_800mA.npz")["air_S1"]
    np.testing.assert_allclose(scan.incident, air / 1400.0, rtol=1e-6)
    np.testing.assert_allclose(-torch.log(scan.counts / scan.incident), prep, atol=2e-6)
    coefficients = np.load(folder / "bhc_poly.npz")["coef"]
    corrected = scan.beam_hardening.correct(torch.from_numpy(prep).double())
    expected = np.stack(
        [np.polyval(row, column) for row, column in zip(coefficients, prep.T.astype(float), strict=True)], -1
    )
    np.testing.assert_allclose(corrected, expected, atol=1e-9)


def test_the_mean_signal_of_catsim_comes_in_as_counts(shared_data):
    folder = shared_data / "catsim" / "chest"
    scan = scan_from_arrays(
        f"{folder}/signal_mean_800mA.npz:S1",
        folder / "geometry.json",
        kind="counts",
        incident=f"{folder}/signal_mean_800mA.npz:air_S1",
        signal_per_quantum=70.0,
    )
    clean = np.load(folder / "prep_clean.npz")["prep"]
    np.testing.assert_allclose(-torch.log(scan.counts / scan.incident), clean, atol=2e-6)


# The Helsinki scanner: at the angle θ the source is at R (cos θ, sin θ); the bins run along (−sin θ, cos θ).


@pytest.fixture(scope="module")
def helsinki(shared_data):
    path = shared_data / "htc2022" / "htc2022_tb_stitched_549views.npz"
    with np.load(path) as content:
        return (
            path,
            content["sino"],
            np.radians(content["angles_deg"].astype(float)),
            json.loads(str(content["meta"])),
        )


@pytest.fixture(scope="module")
def helsinki_scan(helsinki):
    path, _, _, meta = helsinki
    geometry = {
        "source_to_isocenter_mm": meta["SOD_mm"],
        "source_to_detector_mm": meta["SDD_mm"],
        "bins": meta["n_detectors"],
        "bin_width_mm": meta["detector_pixel_mm"],
        "detector": "flat",
        "view_angles_deg": f"{path}:angles_deg",
        "source_at_zero_angle": "+x",
        "bin_direction": -1,
    }
    return scan_from_arrays(f"{path}:sino", geometry, incident=1e5)


def test_helsinkis_rays_are_where_they_were_measured(helsinki_scan, helsinki):
    _, _, angles, meta = helsinki
    away = np.stack([np.cos(angles), np.sin(angles)], -1)
    along = np.stack([-np.sin(angles), np.cos(angles)], -1)
    np.testing.assert_allclose(helsinki_scan.geometry.focal_spots(), meta["SOD_mm"] * away, atol=1e-4)
    position = (np.arange(560) - 559 / 2) * meta["detector_pixel_mm"]
    middle = (meta["SOD_mm"] - meta["SDD_mm"]) * away
    measured = middle[:, None] + position[:, None] * along[:, None]
    ours = helsinki_scan.geometry.detector_points(helsinki_scan.geometry.fan_angles)
    np.testing.assert_allclose(ours[:, ::-1], measured, atol=1e-4)


def test_helsinkis_line_integrals_are_those_of_the_array(helsinki_scan, helsinki):
    values = -torch.log(helsinki_scan.counts / helsinki_scan.incident)
    np.testing.assert_allclose(values.flip(-1), helsinki[1], atol=1e-6)


def test_helsinkis_opposite_rays_agree_in_this_order_of_bins_only(helsinki_scan):
    """The ray (β, γ) is the ray (β + π + 2γ, −γ); bins in the wrong order would take β + π − 2γ."""
    values = -torch.log(helsinki_scan.counts / helsinki_scan.incident).numpy()
    beta = np.degrees(helsinki_scan.geometry.view_angles)
    known = {round(2 * angle) % 720: view for view, angle in enumerate(beta)}
    gamma = np.degrees(helsinki_scan.geometry.fan_angles)

    def difference(sign):
        pairs = []
        for wanted in np.arange(-5.0, 5.5, 0.5):  # 2γ a multiple of the step of 0.5 degrees
            bin_there, bin_back = np.abs(gamma - wanted).argmin(), np.abs(gamma + wanted).argmin()
            for view, angle in enumerate(beta):
                opposite = known.get(round(2 * (angle + 180.0 + sign * 2 * wanted)) % 720)
                if opposite is not None:
                    pairs.append((values[view, bin_there], values[opposite, bin_back]))
        there, back = np.transpose(pairs)
        assert len(there) > 1000
        return np.abs(there - back).mean()

    assert difference(+1) < 0.3 * difference(-1)
