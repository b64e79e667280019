import json
import shutil

import h5py
import numpy as np
import pytest
import torch

from pnpct.files import (
    FileFormatError,
    Provenance,
    describe_file,
    read_image,
    read_scan,
    read_truth,
    write_scan,
)
from pnpct.geometry import FanBeam, ImageGrid
from pnpct.physics import BeamHardening, BoneHardening, Scan

PROVENANCE = Provenance(["pnpct", "simulate"], "0.1.0", seed=7)


def a_scan(geometry, generator, *, batch=(), incident=None, beam_hardening=None):
    return Scan(
        counts=1000.0 * torch.rand(*batch, *geometry.shape, generator=generator) - 3.0,
        incident=torch.tensor(1000.0) if incident is None else incident,
        electronic_noise=2.9,
        geometry=geometry,
        mu_water=0.0193,
        beam_hardening=beam_hardening,
    )


def moving_spot(geometry):
    return FanBeam(
        view_angles=geometry.view_angles,
        bins=geometry.bins,
        source_to_isocenter=541.0,
        source_to_detector=949.0,
        bin_width=1.0239,
        detector_offset=-1.25,
        detector="flat",
        focal_spot_shifts=[(0.3 * (-1) ** view, 0.1) for view in range(geometry.views)],
    )


@pytest.fixture
def path(tmp_path, geometry, generator, grid, disk):
    """A scan with all there can be in its file."""
    hardening = BeamHardening(torch.tensor([[0.01, 1.0, 0.0]]).expand(geometry.bins, 3).double())
    scan = a_scan(geometry, generator, beam_hardening=hardening)
    write_scan(tmp_path / "scan.h5", scan, provenance=PROVENANCE, truth=(disk, grid), description="a disk")
    return tmp_path / "scan.h5"


@pytest.mark.parametrize("batch", [(), (3,), (2, 1)])
@pytest.mark.parametrize("per", ["number", "bin", "view", "ray"])
def test_a_scan_comes_back_as_it_was(tmp_path, geometry, generator, batch, per):
    shape = {"number": (), "bin": (geometry.bins,), "view": (geometry.views, 1), "ray": geometry.shape}[per]
    bone = BoneHardening(torch.arange(6.0).expand(geometry.bins, 6) / 100, compact=2.5)
    hardening = BeamHardening(torch.tensor([[0.01, 1.0, 0.0]]).expand(geometry.bins, 3), bone)
    incident = 1000.0 + torch.rand(shape, generator=generator)
    before = a_scan(geometry, generator, batch=batch, incident=incident, beam_hardening=hardening)
    write_scan(tmp_path / "scan.h5", before, provenance=PROVENANCE)
    after = read_scan(tmp_path / "scan.h5")
    assert torch.equal(after.counts, before.counts)
    assert torch.equal(after.incident, before.incident)
    assert (after.electronic_noise, after.mu_water) == (before.electronic_noise, before.mu_water)
    assert after.geometry == before.geometry
    assert torch.equal(after.beam_hardening.coefficients, before.beam_hardening.coefficients)
    assert after.beam_hardening.coefficients.dtype == torch.float32
    assert torch.equal(after.beam_hardening.bone.coefficients, bone.coefficients)
    assert after.beam_hardening.bone.compact == 2.5


def test_a_flat_detector_and_a_moving_focal_spot_come_back(tmp_path, geometry, generator):
    before = a_scan(moving_spot(geometry), generator)
    write_scan(tmp_path / "scan.h5", before, provenance=PROVENANCE)
    after = read_scan(tmp_path / "scan.h5")
    assert after.geometry == before.geometry
    assert after.beam_hardening is None


def test_the_truth_comes_back_with_its_grid(tmp_path, geometry, generator):
    grid = ImageGrid(5, 7, spacing=0.7, center=(-3.0, 20.5))
    truth = torch.rand(2, 5, 7, generator=generator)
    scan = a_scan(geometry, generator, batch=(2,))
    write_scan(tmp_path / "scan.h5", scan, provenance=PROVENANCE, truth=(truth, grid))
    image, read_grid = read_truth(tmp_path / "scan.h5")
    assert torch.equal(image, truth)
    assert read_grid == grid


def test_there_may_be_no_truth(tmp_path, geometry, generator):
    write_scan(tmp_path / "scan.h5", a_scan(geometry, generator), provenance=PROVENANCE)
    assert read_truth(tmp_path / "scan.h5") is None


def test_a_truth_must_fit_its_grid(tmp_path, geometry, generator):
    truth = torch.zeros(5, 6), ImageGrid(5, 7, spacing=0.7)
    with pytest.raises(ValueError, match=r"must end in the grid's \(5, 7\), got \(5, 6\)"):
        write_scan(tmp_path / "scan.h5", a_scan(geometry, generator), provenance=PROVENANCE, truth=truth)
    assert list(tmp_path.iterdir()) == []


def test_the_file_explains_itself_to_h5py(path, geometry):
    with h5py.File(path) as file:
        assert (file.attrs["format"], file.attrs["format_version"]) == ("pnpct-scan", 1)
        assert json.loads(file.attrs["provenance"])["seed"] == 7
        assert file.attrs["mu_water_per_mm"] == 0.0193
        assert file["counts"].dtype == np.float32
        assert (file["counts"].compression, file["counts"].shuffle) == ("gzip", True)
        assert file["counts"].attrs["units"] == "quanta"
        assert file["geometry/view_angles"].attrs["units"] == "rad"
        assert file["geometry"].attrs["source_to_isocenter_mm"] == geometry.source_to_isocenter
        datasets = []
        file.visititems(lambda _, item: datasets.append(item) if isinstance(item, h5py.Dataset) else None)
        assert len(datasets) == 6
        assert all(dataset.attrs["units"] and dataset.attrs["description"] for dataset in datasets)


def test_blocks_of_whole_views_are_compressed(tmp_path, generator, geometry):
    wide = FanBeam([0.001 * view for view in range(700)], 512, 541.0, 949.0, 1.0)
    write_scan(tmp_path / "scan.h5", a_scan(wide, generator, batch=(2,)), provenance=PROVENANCE)
    with h5py.File(tmp_path / "scan.h5") as file:
        assert file["counts"].chunks == (1, 128, 512)


def test_a_description_needs_no_arrays(path, geometry, monkeypatch):
    monkeypatch.setattr(h5py.Dataset, "__getitem__", lambda *_: pytest.fail("an array was loaded"))
    known = describe_file(path)
    assert (known["format"], known["format_version"], known["description"]) == ("pnpct-scan", 1, "a disk")
    assert known["provenance"]["command"] == ["pnpct", "simulate"]
    assert known["arrays"]["counts"]["shape"] == geometry.shape
    assert known["arrays"]["counts"]["units"] == "quanta"
    assert known["attributes"]["geometry"]["bins"] == geometry.bins
    assert known["attributes"]["/"] == {"mu_water_per_mm": 0.0193}
    assert json.loads(json.dumps(known))["attributes"]["truth/image"]["center_xy_mm"] == [0.0, 0.0]


def test_a_long_provenance_finds_room(tmp_path, geometry, generator):
    provenance = Provenance(["pnpct", *(f"slice_{number}.h5" for number in range(20_000))], "0.1.0")
    write_scan(tmp_path / "scan.h5", a_scan(geometry, generator), provenance=provenance)
    assert describe_file(tmp_path / "scan.h5")["provenance"] == vars(provenance)


def test_one_scan_gives_the_same_bytes_twice(tmp_path, geometry, generator):
    scan = a_scan(geometry, generator)
    for name in ("a.h5", "b.h5"):
        write_scan(tmp_path / name, scan, provenance=PROVENANCE)
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()


def test_an_older_file_is_replaced_and_a_failure_leaves_it(path, geometry, generator, monkeypatch):
    old = path.read_bytes()
    monkeypatch.setattr("pnpct.files.scan_file.write_geometry_group", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        write_scan(path, a_scan(geometry, generator), provenance=PROVENANCE)
    assert path.read_bytes() == old
    assert list(path.parent.iterdir()) == [path]
    monkeypatch.undo()
    write_scan(path, a_scan(geometry, generator), provenance=PROVENANCE)
    assert read_truth(path) is None


@pytest.mark.parametrize("kept", [0.0, 0.0001, 0.01, 0.3, 0.7, 0.999])
def test_a_truncated_file_is_one_sentence(path, kept):
    content = path.read_bytes()
    path.write_bytes(content[: int(kept * len(content))])
    with pytest.raises(FileFormatError, match=rf"^{path}: this (file is truncated|is not an HDF5 file); .*\.$"):
        read_scan(path)


def test_damaged_counts_are_noticed(path):
    with h5py.File(path) as file:
        where = file["counts"].id.get_chunk_info(0).byte_offset
    content = bytearray(path.read_bytes())
    content[where + 100 : where + 200] = bytes(100)
    path.write_bytes(content)
    with pytest.raises(FileFormatError, match=r"this file is damaged .*; copy it again or create it again"):
        read_scan(path)


def test_other_files_are_refused(tmp_path, path, geometry):
    with pytest.raises(FileNotFoundError, match="There is no file"):
        read_scan(tmp_path / "absent.h5")
    with pytest.raises(IsADirectoryError, match="is a folder"):
        read_scan(tmp_path)
    (tmp_path / "notes.h5").write_text("these are my notes " * 100)
    with pytest.raises(FileFormatError, match="this is not an HDF5 file"):
        read_scan(tmp_path / "notes.h5")
    with h5py.File(tmp_path / "mine.h5", "w") as file:
        file["counts"] = np.ones(geometry.shape)
    with pytest.raises(FileFormatError, match="an HDF5 file, but not one of pnpct's"):
        read_scan(tmp_path / "mine.h5")
    with pytest.raises(FileFormatError, match='format "pnpct-scan" was given where "pnpct-image" was needed'):
        read_image(path)


def test_a_file_that_is_being_written_is_one_sentence(path):
    fcntl = pytest.importorskip("fcntl", reason="this system locks files otherwise")
    with path.open() as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        with pytest.raises(FileFormatError, match="this file is being written by another program; wait"):
            read_scan(path)


def edit(path, change):
    copy = path.with_name("edited.h5")
    shutil.copy(path, copy)
    with h5py.File(copy, "r+") as file:
        change(file)
    return copy


def replace(name, values):
    def change(file):
        del file[name]
        file[name] = values

    return change


@pytest.mark.parametrize("name", ["counts", "incident", "electronic_noise", "geometry/view_angles"])
def test_a_missing_dataset_is_named(path, name):
    edited = edit(path, lambda file: file.pop(name))
    with pytest.raises(FileFormatError, match=f"edited.h5: the dataset /{name} is missing in this file; create it"):
        read_scan(edited)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda file: file.pop("geometry"),
            "edited.h5: the group /geometry is missing in this file; create it again",
        ),
        (
            lambda file: file["geometry"].attrs.pop("bin_width_mm"),
            "the attribute bin_width_mm of /geometry is missing in this file",
        ),
        (
            lambda file: file.attrs.pop("mu_water_per_mm"),
            "the attribute mu_water_per_mm of / is missing in this file",
        ),
        (
            lambda file: file.attrs.update(format_version=2),
            "version 2 is newer than the 1 known here; update pnpct",
        ),
        (
            lambda file: file["geometry"].attrs.update(bins=47),
            r"shape \(60, 48\), but the geometry is for \(60, 47\)",
        ),
        (
            lambda file: file["geometry"].attrs.update(bin_width_mm=-1.0),
            "bin_width must be a positive length in mm",
        ),
        (replace("counts", "many"), "/counts must hold numbers"),
        (replace("counts", np.full((60, 48), np.nan)), "/counts holds values that are not finite"),
        (replace("incident", np.ones(7)), r"incident must broadcast to .* got \(7,\)"),
        (replace("incident", 0.0), "incident must be positive"),
        (replace("electronic_noise", np.ones(2)), r"must be one number, got the shape \(2,\)"),
        (replace("geometry/view_angles", np.ones((2, 2))), r"view angles must have the shape \(views,\)"),
        (lambda file: file["geometry"].attrs.update(detector_rows=2), "row_height_mm of /geometry is missing"),
        (replace("beam_hardening/coefficients", np.ones((7, 2))), "for 7 bins, the scan has 48"),
        (replace("geometry", 1.0), "the group /geometry is missing in this file"),
    ],
)
def test_content_that_does_not_fit_is_one_sentence(path, change, message):
    with pytest.raises(FileFormatError, match=message) as raised:
        read_scan(edit(path, change))
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("attribute", "value", "message"),
    [
        ("rows", 31, r"the image has the shape \(32, 32\), but its grid \(31, 32\)"),
        ("cols", [1, 2], r"cols of /truth/image must be a finite number, got \[1, 2\]"),
        ("spacing_mm", -1.0, "pixel spacing must be a positive length in mm, got -1.0"),
        ("center_xy_mm", 3.0, "center_xy_mm of /truth/image must be 2 finite numbers, got 3.0"),
    ],
)
def test_a_truth_that_does_not_fit_is_one_sentence(path, attribute, value, message):
    edited = edit(path, lambda file: file["truth/image"].attrs.update({attribute: value}))
    with pytest.raises(FileFormatError, match=message):
        read_truth(edited)
