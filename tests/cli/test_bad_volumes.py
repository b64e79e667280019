"""Scans and disks from which no volume can come: one sentence, and what was there is there."""

import subprocess
from dataclasses import replace

import pytest
from cone_scans import HELIX, scan_of_water
from mistakes import contents

from pnpct.files import Provenance, sole_writer, write_scan
from pnpct.geometry import Trajectory

WORDS = ["--method", "fbp", "--size", "24", "--field-of-view", "240"]


@pytest.fixture(scope="module")
def scan():
    return scan_of_water(HELIX)


@pytest.mark.parametrize(
    ("views", "complaint"),
    [
        (
            [*range(50), *range(105, 160)],
            "need the views of the helix between z = 15.31 and 32.81 mm, which are missing",
        ),
        (range(30), "needs the views of 0.60 turns of a helix, but this one has 0.47 turns; give a longer scan"),
    ],
    ids=["a missing third", "less than half a turn"],
)
def test_scans_with_too_few_views(run, scan, tmp_path, views, complaint):
    write_scan(tmp_path / "scan.h5", scan[list(views)], provenance=Provenance(["pnpct"], "0.1.0"))
    before = contents(tmp_path)
    for output in ("out.h5", "series/"):
        status, _, err = run("reconstruct", tmp_path / "scan.h5", f"{tmp_path}/{output}", *WORDS)
        assert (status, err.count("\n")) == (2, 1)
        assert complaint in err
        assert contents(tmp_path) == before


@pytest.mark.parametrize("views", [range(30), [7]], ids=["less than half a turn", "one view"])
def test_axial_scans_with_too_few_views(run, tmp_path, views):
    circle = replace(HELIX, trajectory=Trajectory(HELIX.trajectory.angles))
    write_scan(tmp_path / "scan.h5", scan_of_water(circle[list(views)]), provenance=Provenance(["pnpct"], "0.1.0"))
    before = contents(tmp_path)
    status, _, err = run("reconstruct", tmp_path / "scan.h5", tmp_path / "out.h5", *WORDS)
    assert (status, err.count("\n")) == (2, 1)
    assert "needs the views of 0.60 turns, but this axial scan has 0." in err
    assert contents(tmp_path) == before
    assert "slices: none has all its views\n" in run("info", tmp_path / "scan.h5")[1]


def test_slices_that_have_no_half_turn_around_them(run, scan, tmp_path):
    write_scan(tmp_path / "scan.h5", scan, provenance=Provenance(["pnpct"], "0.1.0"))
    near_the_end = ["--center", "0", "0", "47", "--slices", "2"]
    status, _, err = run("reconstruct", tmp_path / "scan.h5", tmp_path / "out.h5", *WORDS, *near_the_end)
    assert (status, err.count("\n")) == (2, 1)
    assert "The scan covers slices from" in err


@pytest.mark.slow
@pytest.mark.parametrize("output", ["out.h5", "out.nii.gz", "series/"])
def test_a_disk_that_is_full_at_any_time(run, scan, tmp_path, monkeypatch, output):
    """A real one, of a few kilobytes more each time; the volume that is made at last is that of an empty disk."""
    write_scan(tmp_path / "scan.h5", scan, provenance=Provenance(["pnpct"], "0.1.0"))
    disk, whole = tmp_path / "disk", tmp_path / "whole"
    for folder in (disk, whole):
        folder.mkdir()
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=16k", "tmpfs", disk], capture_output=True)
    if mounted.returncode:
        pytest.skip("this user may not make a small disk")
    try:
        command = ["reconstruct", "../scan.h5", output, *WORDS, "--slices", "20", "--slice-spacing", "0.5"]
        monkeypatch.chdir(whole)
        assert run(*command)[0] == 0
        monkeypatch.chdir(disk)
        ends = []
        for size in range(16, 400, 24):
            subprocess.run(["mount", "-o", f"remount,size={size}k", disk], check=True)
            status, _, err = run(*command)
            ends.append(status)
            if not status:
                break
            assert (status, err.count("\n")) == (2, 1)
            assert "the disk is full" in err or "No space left" in err
        assert ends[-1] == 0
        assert len(ends) > 3
        assert contents_of(disk) == contents_of(whole)
    finally:
        monkeypatch.chdir(tmp_path)
        subprocess.run(["umount", disk], check=True)


def contents_of(folder):
    return {name.removeprefix(f"{folder}/"): value for name, value in contents(folder).items()}


def test_a_second_writer_of_a_volume_is_told(run, scan, tmp_path):
    write_scan(tmp_path / "scan.h5", scan, provenance=Provenance(["pnpct"], "0.1.0"))
    with sole_writer(tmp_path / "out.h5"):
        before = contents(tmp_path)
        status, _, err = run("reconstruct", tmp_path / "scan.h5", tmp_path / "out.h5", *WORDS)
        assert status == 2
        assert "out.h5 is being written by another process" in err
        assert contents(tmp_path) == before
