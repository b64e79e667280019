import json

import numpy as np
import pytest
import torch

from pnpct.files import FileFormatError, scan_from_catsim

CONFIGURATION = """
scanner.sid = 541.0
scanner.sdd = 949.0
scanner.detectorColCount = 6
scanner.detectorColSize = 20.0
scanner.detectorColOffset = 0.25
scanner.detectorRowCount = 3
scanner.detectionGain = 10.0
scanner.eNoise = 2100.0
protocol.viewsPerRotation = 8
protocol.viewCount = 4
"""
KEV = 70.0


class Run:
    """Raw files as CatSim writes them: [view, row, column] in float32, each row with its offset and air."""

    def __init__(self, folder, *, air_views=1):
        generator = np.random.default_rng(3)
        self.prefix = folder / "results" / "chest.v2"
        self.prefix.parent.mkdir()
        self.cfg = folder / "scan.cfg"
        self.cfg.write_text(CONFIGURATION)
        self.line_integrals = generator.uniform(0.0, 4.0, (4, 3, 6))
        self.offset = generator.uniform(0.0, 5.0, (1, 3, 6))
        self.air = generator.uniform(1e6, 2e6, (air_views, 3, 6))
        mean_air = self.air if air_views == 4 else self.air.mean(axis=0)
        self.write("air", self.air + self.offset)
        self.write("offset", self.offset)
        self.write("scan", mean_air * np.exp(-self.line_integrals) + self.offset)
        self.write("prep", self.line_integrals)

    def path(self, suffix):
        return self.prefix.with_name(f"{self.prefix.name}.{suffix}")

    def write(self, suffix, values):
        values.astype("<f4").tofile(self.path(suffix))

    def read(self, **options):
        return scan_from_catsim(self.prefix, **{"configuration": self.cfg, "kev_per_quantum": KEV, **options})


@pytest.fixture
def run(tmp_path):
    return Run(tmp_path)


@pytest.mark.parametrize("row", [0, 1, 2])
@pytest.mark.parametrize("signal", ["raw", "prep"])
def test_a_row_of_the_raw_files_becomes_a_scan(run, row, signal):
    scan = run.read(detector_row=row, signal=signal)
    np.testing.assert_allclose(scan.incident, run.air[0, row] / (10.0 * KEV), rtol=1e-6)
    np.testing.assert_allclose(-torch.log(scan.counts / scan.incident), run.line_integrals[:, row], atol=2e-6)
    assert scan.electronic_noise == pytest.approx(2100.0 / (10.0 * KEV))
    assert np.degrees(scan.geometry.view_angles) == pytest.approx([0.0, 45.0, 90.0, 135.0])


def test_the_middle_row_is_read_by_default(run):
    assert torch.equal(run.read().counts, run.read(detector_row=1).counts)


@pytest.mark.parametrize(("air_views", "shape"), [(1, (6,)), (3, (6,)), (4, (4, 6))])
def test_air_views_are_averaged_unless_there_is_one_a_view(tmp_path, air_views, shape):
    run = Run(tmp_path, air_views=air_views)
    scan = run.read()
    assert scan.incident.shape == shape
    np.testing.assert_allclose(-torch.log(scan.counts / scan.incident), run.line_integrals[:, 1], atol=2e-6)


def test_without_an_offset_scan_the_offset_is_zero(run):
    run.path("offset").unlink()
    np.testing.assert_allclose(run.read().incident, (run.air + run.offset)[0, 1] / (10.0 * KEV), rtol=1e-6)


def test_the_energy_of_a_quantum_changes_no_line_integral(run):
    light, heavy = run.read(kev_per_quantum=35.0), run.read()
    torch.testing.assert_close(light.counts, 2.0 * heavy.counts)
    torch.testing.assert_close(light.counts / light.incident, heavy.counts / heavy.incident)
    assert light.electronic_noise == pytest.approx(2.0 * heavy.electronic_noise)


def test_given_quanta_make_the_air_scan_needless(run):
    run.path("air").unlink()
    run.path("offset").unlink()
    scan = run.read(signal="prep", incident=2e5, mu_water=0.02)
    assert (scan.incident, scan.mu_water) == (2e5, 0.02)
    np.testing.assert_allclose(scan.counts, 2e5 * np.exp(-run.line_integrals[:, 1]), rtol=1e-6)


def test_a_beam_hardening_correction_comes_from_a_file(run, tmp_path):
    coefficients = np.random.default_rng(4).uniform(0.1, 1.0, (6, 4))
    np.save(tmp_path / "bhc.npy", coefficients)
    scan = run.read(beam_hardening=tmp_path / "bhc.npy")
    np.testing.assert_array_equal(scan.beam_hardening.coefficients, coefficients)


def test_a_json_file_may_stand_for_the_configuration(run, tmp_path):
    keys = {"sid_mm": 541.0, "sdd_mm": 949.0, "n_cols": 6, "col_pitch_mm": 20.0, "col_offset_cols": 0.25}
    views = {"n_views": 4, "views_per_rotation": 8, "start_angle_deg": 0, "rotation_direction": 1}
    path = tmp_path / "geometry.json"
    path.write_text(json.dumps({**keys, **views, "gain_e_per_keV": 10.0, "eNoise_e": 2100.0}))
    by_json, by_cfg = run.read(configuration=path), run.read()
    assert torch.equal(by_json.counts, by_cfg.counts)
    assert by_json.geometry.view_angles == pytest.approx(by_cfg.geometry.view_angles)
    assert by_json.electronic_noise == by_cfg.electronic_noise


@pytest.mark.parametrize("suffix", ["scan", "air", "offset"])
@pytest.mark.parametrize("missing", [1, 4, 72])
def test_a_truncated_raw_file_is_one_sentence(run, suffix, missing):
    content = run.path(suffix).read_bytes()
    run.path(suffix).write_bytes(content[:-missing])
    with pytest.raises(
        FileFormatError, match=f"^{run.path(suffix)} has {len(content) - missing} bytes, but .* truncated"
    ):
        run.read()


def test_a_scan_of_another_size_is_one_sentence(run):
    run.cfg.write_text(CONFIGURATION.replace("viewCount = 4", "viewCount = 5"))
    with pytest.raises(
        FileFormatError, match=r"has 288 bytes, but 5 times 72 was needed \(3 rows x 6 columns a view\)"
    ):
        run.read()


@pytest.mark.parametrize("suffix", ["scan", "air"])
def test_missing_raw_files_are_named(run, suffix):
    run.path(suffix).unlink()
    with pytest.raises(FileNotFoundError, match=f"There is no file {run.path(suffix)}"):
        run.read()


def test_values_that_are_not_finite_are_counted(run):
    values = run.line_integrals.copy()
    values[2, 1, 3] = values[0, 1, 0] = values[0, 0, 0] = np.nan
    values = values.astype(np.float32)
    values.view(np.uint32)[0, 1, 0] = 0x7F800001  # a NaN that signals: numpy would warn as it converts it
    run.write("prep", values)
    with pytest.raises(FileFormatError, match="holds 2 values that are not finite in row 1"):
        run.read(signal="prep")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"detector_row": 3}, "The detector has the rows 0 to 2, but row 3 was asked for"),
        ({"detector_row": -1}, "but row -1 was asked for"),
        ({"kev_per_quantum": 0.0}, "kev_per_quantum must be a positive energy in keV, got 0.0"),
        ({"incident": -1.0}, "incident must be positive"),
    ],
)
def test_numbers_out_of_range_are_one_sentence(run, options, message):
    with pytest.raises(ValueError, match=message):
        run.read(**options)
