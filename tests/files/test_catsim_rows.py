"""All rows of CatSim's raw files: a cone beam, axial or helical."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from pnpct.files import FileFormatError, scan_from_catsim

ROWS, COLUMNS, VIEWS = 3, 6, 4
CONFIGURATION = """
scanner.sid = 541.0
scanner.sdd = 949.0
scanner.detectorColCount = 6
scanner.detectorColSize = 20.0
scanner.detectorColOffset = 0.25
scanner.detectorRowCount = 3
scanner.detectorRowSize = 1.1
scanner.detectorRowOffset = 0.5
scanner.detectionGain = [10.0, 20.0, 10.0]
scanner.eNoise = 2100.0
protocol.viewsPerRotation = 8
protocol.viewCount = 4
"""
HELIX = """
protocol.rotationTime = 0.5
protocol.startZ = 12.0
protocol.tableSpeed = -40.0
"""


@pytest.fixture
def prefix(tmp_path):
    generator = np.random.default_rng(3)
    air = generator.uniform(1e6, 2e6, (1, ROWS, COLUMNS))
    scan = air * np.exp(-generator.uniform(0.0, 4.0, (VIEWS, ROWS, COLUMNS)))
    for suffix, values in (("air", air), ("scan", scan), ("prep", -np.log(scan / air))):
        values.astype("<f4").tofile(tmp_path / f"run.{suffix}")
    (tmp_path / "axial.cfg").write_text(CONFIGURATION)
    (tmp_path / "helix.cfg").write_text(CONFIGURATION + HELIX)
    return tmp_path / "run"


def read(prefix, kind="axial", **options):
    return scan_from_catsim(prefix, configuration=prefix.with_name(f"{kind}.cfg"), **options)


@pytest.mark.parametrize("signal", ["raw", "prep"])
def test_all_rows_are_the_single_rows_together(prefix, signal):
    together = read(prefix, all_rows=True, signal=signal)
    for row in range(ROWS):
        alone = read(prefix, detector_row=row, signal=signal)
        assert torch.equal(together.counts[:, row], alone.counts)
        assert torch.equal(together.incident[row], alone.incident)


def test_the_rows_and_the_heights_are_those_of_the_configuration(prefix):
    geometry = read(prefix, "helix", all_rows=True).geometry
    assert geometry.shape == (VIEWS, ROWS, COLUMNS)
    assert geometry.detector.row_positions == pytest.approx([-0.55, 0.55, 1.65])
    # CatSim moves the patient: the gantry rises where the table falls, 20 mm a turn here, from −12 mm.
    assert geometry.trajectory.z == pytest.approx([-12.0, -9.5, -7.0, -4.5])
    assert geometry.trajectory.angles == pytest.approx([math.pi / 4 * view for view in range(VIEWS)])


def test_a_table_at_rest_is_where_it_was_put(prefix):
    assert read(prefix, all_rows=True).geometry.trajectory.heights.tolist() == [0.0] * VIEWS
    path = prefix.with_name("axial.cfg")
    path.write_text(path.read_text() + "protocol.startZ = 3.0\nprotocol.dutyRatio = 0.5\n")
    assert read(prefix, all_rows=True).geometry.trajectory.heights.tolist() == [-3.0] * VIEWS


def test_shorter_pulses_come_earlier_and_lower(prefix):
    whole = read(prefix, "helix", all_rows=True).geometry.trajectory
    path = prefix.with_name("helix.cfg")
    path.write_text(path.read_text() + "protocol.dutyRatio = 0.5\nprotocol.startViewId = 1\n")
    short = read(prefix, "helix", all_rows=True).geometry.trajectory
    moved = replace(whole, z=[height + 0.75 * 2.5 for height in whole.z])
    assert short.z == pytest.approx(moved.z)
    assert short.angles[0] == pytest.approx(0.75 * math.pi / 4)


def test_what_rows_need_is_said(prefix):
    with pytest.raises(FileFormatError, match=r"a table that moves .* read all of its rows"):
        read(prefix, "helix")
    with pytest.raises(ValueError, match="Either all rows are read or row 1"):
        read(prefix, all_rows=True, detector_row=1)
    path = prefix.with_name("axial.cfg")
    path.write_text(path.read_text().replace("scanner.detectorRowSize = 1.1", ""))
    with pytest.raises(FileFormatError, match=r"All rows need scanner\.detectorRowSize"):
        read(prefix, all_rows=True)
