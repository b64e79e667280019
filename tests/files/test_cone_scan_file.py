"""Scan files with detector rows and heights."""

from dataclasses import replace

import h5py
import pytest
import torch

from pnpct.files import (
    FileFormatError,
    Provenance,
    describe_file,
    read_scan,
    read_scan_geometry,
    read_truth,
    write_scan,
    write_scan_slabs,
)
from pnpct.geometry import ConeBeam, Detector, ImageGrid, Trajectory, VolumeGrid
from pnpct.physics import Scan

PROVENANCE = Provenance(["pnpct", "simulate"], "0.1.0", seed=7)
HELIX = ConeBeam(
    Trajectory([0.1 * view for view in range(6)], z=[0.5 * view - 20.0 for view in range(6)]),
    Detector(4, 2.0, offset=0.25, kind="flat", rows=3, row_height=1.1, row_offset=-0.5),
    source_to_isocenter=541.0,
    source_to_detector=949.0,
)
SHIFTS = [(0.1 * view, 0.0, -0.66 * (view % 2)) for view in range(6)]


def cone_scan(geometry: ConeBeam, generator: torch.Generator, *, batch: tuple[int, ...] = ()) -> Scan:
    counts = 1000.0 * torch.rand(*batch, *geometry.shape, generator=generator)
    return Scan(counts, torch.tensor(1000.0), 2.9, geometry, mu_water=0.0193)


@pytest.mark.parametrize("batch", [(), (2,)])
@pytest.mark.parametrize(
    "trajectory",
    [HELIX.trajectory, Trajectory(HELIX.trajectory.angles), Trajectory(HELIX.trajectory.angles, (), SHIFTS)],
    ids=["helix", "axial", "flying focal spot"],
)
def test_a_scan_with_detector_rows_comes_back_as_it_was(tmp_path, generator, batch, trajectory):
    before = cone_scan(replace(HELIX, trajectory=trajectory), generator, batch=batch)
    write_scan(tmp_path / "scan.h5", before, provenance=PROVENANCE)
    after = read_scan(tmp_path / "scan.h5")
    assert after.geometry == before.geometry
    assert torch.equal(after.counts, before.counts)


def test_h5py_finds_rows_and_heights(tmp_path, generator):
    write_scan(tmp_path / "scan.h5", cone_scan(HELIX, generator), provenance=PROVENANCE)
    with h5py.File(tmp_path / "scan.h5") as file:
        assert file["counts"].shape == (6, 3, 4)
        assert file["geometry/z"][:].tolist() == [-20.0, -19.5, -19.0, -18.5, -18.0, -17.5]
        assert file["geometry/z"].attrs["units"] == "mm"
        lengths = {key: file["geometry"].attrs[key] for key in ("detector_rows", "row_height_mm", "row_offset_rows")}
        assert lengths == {"detector_rows": 3, "row_height_mm": 1.1, "row_offset_rows": -0.5}


def test_one_row_of_a_cone_beam_keeps_its_height(tmp_path, generator):
    one = replace(HELIX, detector=replace(HELIX.detector, rows=1))
    write_scan(tmp_path / "scan.h5", cone_scan(one, generator), provenance=PROVENANCE)
    assert read_scan(tmp_path / "scan.h5").geometry == one


def test_the_truth_of_a_volume_comes_back_with_its_grid(tmp_path, generator):
    grid, truth = VolumeGrid(ImageGrid(5, 7, 0.7), 3, 2.5, z=-18.0), torch.rand(3, 5, 7, generator=generator)
    write_scan(tmp_path / "scan.h5", cone_scan(HELIX, generator), provenance=PROVENANCE, truth=(truth, grid))
    image, read_grid = read_truth(tmp_path / "scan.h5")
    assert torch.equal(image, truth)
    assert read_grid == grid


def numbered(geometry: ConeBeam, generator: torch.Generator, incident: torch.Tensor) -> Scan:
    return replace(cone_scan(geometry, generator), incident=incident)


@pytest.mark.parametrize("shape", [(), (4,), (3, 1), (1, 1, 4), (6, 1, 4), (6, 1, 1), (6, 3, 4)], ids=str)
def test_slabs_of_views_are_written_and_read_as_the_whole(tmp_path, generator, shape):
    whole = numbered(HELIX, generator, 1000.0 + torch.rand(shape, generator=generator))
    write_scan(tmp_path / "whole.h5", whole, provenance=PROVENANCE)
    slabs = (whole[first : first + 2] for first in range(0, 6, 2))
    write_scan_slabs(tmp_path / "slabs.h5", HELIX, slabs, provenance=lambda: PROVENANCE)
    assert describe_file(tmp_path / "slabs.h5") == describe_file(tmp_path / "whole.h5")
    for views in (slice(1, 3), slice(0, 6, 4), slice(5, 6), slice(None)):
        read, cut = read_scan(tmp_path / "slabs.h5", views=views), whole[views]
        assert read.geometry == cut.geometry
        assert torch.equal(read.counts, cut.counts)
        assert torch.equal(read.incident, cut.incident)


def test_the_geometry_is_read_without_the_counts(tmp_path, generator):
    write_scan(tmp_path / "scan.h5", cone_scan(HELIX, generator), provenance=PROVENANCE)
    with h5py.File(tmp_path / "scan.h5", "r+") as file:
        del file["counts"]
    assert read_scan_geometry(tmp_path / "scan.h5") == HELIX


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda slabs: slabs[:2], "the slabs must have all 6 views, got 4"),
        (lambda slabs: [slabs[1], slabs[0], slabs[2]], "slab of the views 0 to 1 was needed"),
        (lambda slabs: [*slabs, slabs[0]], "slab of the views 6 to 7 was needed"),
        (lambda slabs: [slabs[0], replace(slabs[1], mu_water=0.02), slabs[2]], "must agree in all but their views"),
        (lambda slabs: [slabs[0], replace(slabs[1], incident=torch.tensor(7.0)), slabs[2]], "must agree in all but"),
    ],
)
def test_slabs_that_are_not_one_scan_leave_nothing_behind(tmp_path, generator, change, message):
    whole = cone_scan(HELIX, generator)
    slabs = change([whole[first : first + 2] for first in range(0, 6, 2)])
    with pytest.raises(ValueError, match=f"(?i){message}"):
        write_scan_slabs(tmp_path / "scan.h5", HELIX, slabs, provenance=PROVENANCE)
    assert list(tmp_path.iterdir()) == []


def test_no_view_is_no_scan(tmp_path, generator):
    write_scan(tmp_path / "scan.h5", cone_scan(HELIX, generator), provenance=PROVENANCE)
    with pytest.raises(FileFormatError, match="none of the views 6 to 8 is among its 6"):
        read_scan(tmp_path / "scan.h5", views=slice(6, 9))
