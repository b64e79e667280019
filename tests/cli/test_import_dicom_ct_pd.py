"""`pnpct import dicom-ct-pd`, and what `info` says of its scan."""

import json
import re

import numpy as np
import pytest
import torch
from ct_pd_views import CENTRAL_COLUMN, VIEWS, write_folder

from pnpct.files import read_scan


def test_a_folder_becomes_a_scan_that_info_describes(run, tmp_path):
    folder, scan = write_folder(tmp_path / "views", views=70, mode="FFSZ", feed=0.3), tmp_path / "scan.h5"
    status, out, err = run("import", "dicom-ct-pd", folder, scan)
    assert (status, err) == (0, "")
    assert "Wrote" in out
    assert "70 views of 8 rows of 24 bins on an arc" in out
    assert "electronic noise is taken as 0 quanta, which the files do not state" in out
    assert "left and right cannot be known" in out
    read = read_scan(scan)
    assert read.counts.shape == (70, 8, 24)
    assert torch.equal(read_scan(scan, views=slice(60, 70)).counts, read.counts[60:])
    status, described, _ = run("info", scan)
    for line in (
        "path: helix, feed 18.850 mm a turn, pitch 0.716",
        "turns: 1.11, 63 views a turn",
        "rows: 8 of 3.289 mm at the isocentre",
        "focal spot: FFSZ, z = 0.00 to 20.70 mm",
        "slices: z = 5.35 to 15.35 mm",
        "Not corrected for: Scatter.",
    ):
        assert line in described
        assert line in out


def test_the_provenance_names_the_patient_and_has_one_fingerprint(run, tmp_path):
    folder, scan = write_folder(tmp_path / "views"), tmp_path / "scan.h5"
    assert run("import", "dicom-ct-pd", folder, scan)[0] == 0
    written = json.loads((tmp_path / "scan.h5.json").read_text())
    assert written["settings"]["dicom"]["StudyInstanceUID"] == "2.25.1000"
    assert written["settings"]["dicom"]["PatientID"] == "B1"
    before = dict(written["inputs"])
    assert list(before) == [str(folder)]
    (path,) = folder.glob("*.3.dcm")
    path.write_bytes(path.read_bytes().replace(b"Module7029", b"Module7028"))
    assert run("import", "dicom-ct-pd", folder, scan)[0] == 0
    assert json.loads((tmp_path / "scan.h5.json").read_text())["inputs"] != before


def test_the_numbers_that_files_lack_are_options(run, tmp_path):
    def poor(view, number):
        del view[0x70331065], view[0x70411001]

    folder, scan = write_folder(tmp_path / "views", change=poor), tmp_path / "scan.h5"
    options = ("--incident", 1e5, "--mu-water", 0.02, "--electronic-noise", 4)
    assert run("import", "dicom-ct-pd", folder, scan, *options)[0] == 0
    read = read_scan(scan)
    assert (read.mu_water, read.electronic_noise) == (0.02, 4.0)
    assert float(read.incident.mean()) == pytest.approx(1e5)


@pytest.mark.parametrize("removed", [range(0), range(2, VIEWS, 3)], ids=["no photons", "a third of the views"])
def test_a_mistake_gets_one_line_and_leaves_nothing_behind(run, tmp_path, removed):
    def poor(view, number):
        if not removed:
            del view[0x70331065]

    folder = write_folder(tmp_path / "views", change=poor)
    for view in removed:
        next(folder.glob(f"*.{view}.dcm")).unlink()
    status, out, err = run("import", "dicom-ct-pd", folder, tmp_path / "scan.h5")
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert str(folder) in err
    assert [path.name for path in tmp_path.iterdir()] == ["views"]


@pytest.mark.usefixtures("full_disk")
def test_a_full_disk_is_said_also_where_hdf5_reads_what_it_lacks(run, tmp_path):
    folder = write_folder(tmp_path / "views", views=140)  # slabs that end within a chunk, which is read again
    status, out, err = run("import", "dicom-ct-pd", folder, tmp_path / "scan.h5")
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert f"{tmp_path / 'scan.h5'} was not written: the disk is full" in err
    assert [path.name for path in tmp_path.iterdir()] == ["views"]


@pytest.mark.parametrize(
    ("option", "value", "message"),
    [
        ("--incident", 0, "incident must be positive"),
        ("--incident", "nan", "incident must be positive"),
        ("--mu-water", 0, "mu_water must be a positive"),
        ("--electronic-noise", -1, "electronic_noise must be finite and not negative"),
        ("--central-column", "nan", "among the columns 1 to 24, got nan"),
        ("--central-column", 1e6, "among the columns 1 to 24, got 1e+06"),
    ],
)
def test_numbers_that_cannot_be_leave_nothing_behind(run, tmp_path, option, value, message):
    folder = write_folder(tmp_path / "views", views=2)
    status, out, err = run("import", "dicom-ct-pd", folder, tmp_path / "scan.h5", option, value)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert message in err
    assert [path.name for path in tmp_path.iterdir()] == ["views"]


SHARED = {
    "helix": ["--phantom", "--ffs", "FFSXYZ", "--vendor", "ge", "--direct-layout", "--scale-per-view", "--falling"],
    "early": ["--phantom", "--early", "--ffs", "FFSZ", "--shuffle-names"],
    "axial": ["--phantom", "--pitch", "0", "--vr", "explicit", "--dictionary", "v8"],
}


@pytest.mark.parametrize("options", SHARED.values(), ids=SHARED)
def test_folders_by_another_writer_have_its_rays(run, shared_data, tmp_path, options):
    path = shared_data / "volumes" / "write_ctpd.py"
    if not path.is_file():
        pytest.skip("the writer of DICOM-CT-PD is not among the reference scans")
    writer = {"__name__": "write_ctpd", "__file__": str(path)}
    exec(compile(path.read_text(), str(path), "exec"), writer)
    size = ["--columns", "48", "--rows", "6", "--column-mm", "19.7", "--row-mm", "12.0", "--views-per-turn", "40"]
    settings = writer["main"]([str(tmp_path / "views"), *options, *size, "--turns", "1", "--row-mm", "8"])
    options = ["--incident", 1e5] if "--early" in options else []
    assert run("import", "dicom-ct-pd", tmp_path / "views", tmp_path / "scan.h5", *options)[0] == 0
    scan = read_scan(tmp_path / "scan.h5")
    cells = scan.geometry.detector_points(scan.geometry.fan_angles)
    measured = -torch.log(scan.counts.double() / scan.incident.double()).numpy()
    for view in (0, 7, 39):
        spot, wanted = writer["rays"](settings, view)
        assert scan.geometry.focal_spots()[view] == pytest.approx(spot, abs=1e-3)
        assert np.abs(cells[view, :, :2] - wanted[:, 0, :2]).max() < 1e-3
        heights = cells[view, 0, 2] + scan.geometry.detector.row_positions
        assert heights[::-1] == pytest.approx(wanted[0, :, 2], abs=1e-3)
        exact = writer["MU_WATER"] * writer["line_integrals"](spot, wanted).T[::-1]
        assert np.abs(measured[view] - exact).max() < 2e-4


def test_both_halves_of_a_turn_tell_where_the_central_column_is(run, tmp_path):
    def counted_by_the_manual(view, number):
        view.Manufacturer = "GE MEDICAL SYSTEMS"

    options = {"views": 70, "feed": 0.05, "change": counted_by_the_manual}
    folder, scan = write_folder(tmp_path / "views", **options), tmp_path / "scan.h5"
    status, out, _ = run("import", "dicom-ct-pd", folder, scan)
    assert status == 0
    found = re.search(r"do NOT agree; .* central column (\S+) instead of 10.625", out)
    assert float(found[1]) == pytest.approx(CENTRAL_COLUMN, abs=0.2)
    status, out, _ = run("import", "dicom-ct-pd", folder, scan, "--central-column", CENTRAL_COLUMN)
    assert "their edges agree within 0.1 columns" in out
