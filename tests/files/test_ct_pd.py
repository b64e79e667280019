"""Clinical projection data: every variant of the format gives the rays and the line integrals of the ball."""

import math
from itertools import product

import ct_pd_views as writer
import numpy as np
import pytest
import torch
from ct_pd_views import write_folder
from pydicom import dcmread

from pnpct.files import read_slabs, read_views, series_of
from pnpct.files.ct_pd import projection_files, read_view
from pnpct.files.ct_pd.elements import ELEMENTS, PIXELS
from pnpct.physics import Scan


def series_in(folder):
    return series_of(folder, [view for view in read_views(projection_files(folder)) if view])


def scan_in(folder, **options) -> Scan:
    series = series_in(folder)
    slabs = [slab.scan for slab in read_slabs(series, **options)]
    return Scan(
        torch.cat([slab.counts for slab in slabs]),
        torch.cat([slab.incident for slab in slabs]),
        slabs[0].electronic_noise,
        series.geometry,
        slabs[0].mu_water,
    )


def expected_line_integrals(scan: Scan) -> np.ndarray:
    """What the ball attenuates along the rays of the scan's geometry."""
    cells = scan.geometry.detector_points(scan.geometry.fan_angles)[:, None].repeat(scan.geometry.rows, axis=1)
    cells[..., 2] += scan.geometry.detector.row_positions[:, None]
    return writer.MU_WATER * writer.chords(scan.geometry.focal_spots()[:, None, None], cells)


def line_integrals_of(scan: Scan) -> np.ndarray:
    return -torch.log(scan.counts.double() / scan.incident.double()).numpy()


MODES, VENDORS = ("FFSNONE", "FFSZ", "FFSXY", "FFSXYZ"), ("SIEMENS", "GE MEDICAL SYSTEMS")
VARIANTS = [*product(MODES, (8, 10), VENDORS, (True, False))]


@pytest.mark.parametrize(
    ("mode", "version", "vendor", "by_columns"), [*product(MODES, (8, 10), VENDORS, (True, False))]
)
def test_every_variant_has_the_rays_and_the_line_integrals(tmp_path, mode, version, vendor, by_columns):
    options = {"mode": mode, "version": version, "vendor": vendor, "by_columns": by_columns}
    scan = scan_in(write_folder(tmp_path / "a", **options, explicit=version == 8, scale_per_view=by_columns, views=5))
    step = 1.5 * writer.STEP if by_columns else writer.STEP
    assert np.abs(line_integrals_of(scan) - expected_line_integrals(scan)).max() < 0.5 * step + 1e-4
    assert scan.mu_water == writer.MU_WATER
    assert line_integrals_of(scan).max() > 1.0


@pytest.mark.parametrize("explicit", [True, False])
def test_values_may_be_typed_or_bytes(tmp_path, explicit):
    geometry = series_in(write_folder(tmp_path / "a", explicit=explicit)).geometry
    assert geometry.shape == (writer.VIEWS, writer.ROWS, writer.COLUMNS)
    assert geometry.source_to_detector == pytest.approx(writer.DISTANCE)


def test_a_falling_table_and_angles_without_jumps(tmp_path):
    scan = scan_in(write_folder(tmp_path / "a", feed=-0.4))
    assert np.diff(scan.geometry.trajectory.angles) == pytest.approx([0.1] * (writer.VIEWS - 1), abs=1e-6)
    assert scan.geometry.trajectory.z[-1] == pytest.approx(-0.4 * 11)
    assert np.abs(line_integrals_of(scan) - expected_line_integrals(scan)).max() < writer.STEP


def test_the_early_format_has_no_photons_and_water_per_cm(tmp_path):
    folder = write_folder(tmp_path / "a", early=True, mode="FFSXY")
    scan = scan_in(folder, incident=2e4)
    assert scan.mu_water == pytest.approx(writer.MU_WATER)
    assert np.abs(line_integrals_of(scan) - expected_line_integrals(scan)).max() < writer.STEP
    currents = 100 + 10 * np.arange(writer.VIEWS)
    assert scan.incident[:, 0, 0].numpy() == pytest.approx(2e4 * currents / currents.mean())
    with pytest.raises(ValueError, match=r"does not state the quanta .* \(--incident\)"):
        scan_in(folder)


def test_photon_statistics_are_the_incident_quanta_of_views_and_columns(tmp_path):
    scan = scan_in(write_folder(tmp_path / "a"), electronic_noise=3.0)
    assert scan.incident.shape == (writer.VIEWS, 1, writer.COLUMNS)
    assert np.array_equal(scan.incident[2, 0].numpy(), 3 * writer.PHOTONS.astype("f4"))
    assert scan.electronic_noise == 3.0


def test_slabs_are_the_whole(tmp_path, monkeypatch):
    folder = write_folder(tmp_path / "a")
    whole = scan_in(folder)
    monkeypatch.setattr("pnpct.files.ct_pd.pixels.VIEWS_OF_A_SLAB", 5)
    slabs = list(read_slabs(series_in(folder)))
    assert [slab.scan.geometry.views for slab in slabs] == [5, 5, 2]
    assert torch.equal(torch.cat([slab.scan.counts for slab in slabs]), whole.counts)
    assert len({slab.sha256 for slab in slabs}) == 3


def test_line_integrals_keep_their_sixteen_bits(tmp_path):
    def large(view, number):
        values = np.linspace(0, 65535, writer.ROWS * writer.COLUMNS).round().astype("<u2")
        view.PixelData, view.SmallestImagePixelValue, view.LargestImagePixelValue = values.tobytes(), 0, 65535

    values = line_integrals_of(scan_in(write_folder(tmp_path / "a", views=1, change=large)))
    wanted = np.linspace(0, 65535, values.size).round() * writer.STEP + writer.OFFSET
    wanted = wanted.reshape(writer.COLUMNS, writer.ROWS).T[::-1]
    assert wanted.max() > 7.7  # where half precision has steps of 0.004
    assert np.abs(values[0] - wanted).max() < 7e-5


NOT_NEEDED = {
    0x00080018: "which file it is",
    0x00080060: "CT",
    0x00180090: "diameter of data collection: the fan says it",
    0x00181150: "rotation time",
    0x00189311: "pitch: heights and angles say it",
    0x0020000D: "the study, for the provenance",
    0x00200011: "number of the series",
    0x00280002: "one sample a pixel",
    0x00280004: "grey",
    0x00280101: "bits stored, which are the bits allocated",
    0x00280102: "the highest of them",
    0x04000315: "3407.5, which no dictionary has",
    0x7033100E: "flying mode: the shifts say it",
    0x70331013: "steps a turn: the angles say it",
    0x70331061: "number of sources",
    0x70371009: "helical: the heights say it",
    0x7037100A: "fan beam",
}


@pytest.fixture
def real_view(shared_data):
    path = shared_data / "volumes" / "real" / "ctpd_siemens_view.dcm"
    if not path.is_file():
        pytest.skip("the real view is not among the reference scans")
    return path


def test_every_element_of_the_real_view_is_read_or_not_needed(real_view):
    tags = {int(element.tag) for element in dcmread(real_view)}
    creators = {tag for tag in tags if tag >> 16 & 1 and tag & 0xFFFF == 0x0010}
    assert tags - creators - {tag for tag, _ in ELEMENTS.values()} - {PIXELS} == NOT_NEEDED.keys()


def test_the_real_view_is_read(real_view):
    path, view = real_view, read_view(real_view)
    assert (view.layout.columns, view.layout.rows) == (736, 32)
    assert (view.number, view.tube_current_ma, view.layout.tube_voltage_kvp) == (7860, 595.0, 120.0)
    assert view.shift == pytest.approx((3.361e-4, 0.0, 3.36e-5), rel=1e-3)
    assert view.layout.mu_water == pytest.approx(0.0192)
    assert view.layout.uncorrected == ("Scatter",)
    (slab,) = read_slabs(series_of(path.parent, [view]), incident=1e5)
    values = line_integrals_of(slab.scan)
    assert (values.min(), values.max()) == pytest.approx((-0.0113, 5.3532), abs=1e-3)
    spot = slab.scan.geometry.focal_spots()[0]
    assert math.hypot(*spot[:2]) == pytest.approx(595.0, abs=1e-3)
    assert spot[2] == pytest.approx(-764.31, abs=1e-3)
