"""An HDF5 file from elsewhere never makes pnpct read another file."""

import shutil

import h5py
import numpy as np
import pytest
import torch

from pnpct.files import FileFormatError, Provenance, describe_file, read_scan, write_scan
from pnpct.files.self_contained import _TEXT
from pnpct.physics import Scan

SECRET = np.full((60, 48), 1234.5, dtype=np.float32)


@pytest.fixture(scope="module")
def scan_file(geometry, tmp_path_factory):
    path = tmp_path_factory.mktemp("scans") / "scan.h5"
    scan = Scan(torch.full((60, 48), 500.0), torch.tensor(1000.0), 3.0, geometry, mu_water=0.02)
    write_scan(path, scan, provenance=Provenance([], "0"))
    return path


@pytest.fixture
def folder(scan_file, tmp_path):
    """A scan to change, and private files beside it."""
    shutil.copy(scan_file, tmp_path / "scan.h5")
    SECRET.tofile(tmp_path / "secret.raw")
    with h5py.File(tmp_path / "secret.h5", "w") as file:
        file["counts"] = SECRET
    return tmp_path


def external_storage(file, folder):
    place = [(str(folder / "secret.raw"), 0, h5py.h5f.UNLIMITED)]
    file.create_dataset("counts", SECRET.shape, SECRET.dtype, external=place)


def external_link(file, folder):
    file["counts"] = h5py.ExternalLink(str(folder / "secret.h5"), "/counts")


def soft_link_to_an_external_one(file, folder):
    file["aside"] = h5py.ExternalLink(str(folder / "secret.h5"), "/")
    file["counts"] = h5py.SoftLink("/aside/counts")


def virtual(file, folder):
    layout = h5py.VirtualLayout(SECRET.shape, SECRET.dtype)
    layout[:] = h5py.VirtualSource(str(folder / "secret.h5"), "counts", SECRET.shape)
    file.create_virtual_dataset("counts", layout)


@pytest.mark.parametrize("lead_away", [external_storage, external_link, soft_link_to_an_external_one, virtual])
@pytest.mark.parametrize("read", [read_scan, describe_file])
def test_values_in_another_file_are_not_read(lead_away, read, folder):
    with h5py.File(folder / "scan.h5", "r+") as file:
        del file["counts"]
        lead_away(file, folder)
    with h5py.File(folder / "scan.h5") as file:
        assert np.array_equal(file["counts"][()], SECRET)  # h5py would follow
    with pytest.raises(FileFormatError, match="another file"):
        read(folder / "scan.h5")


def test_what_lies_deep_in_the_file_is_checked_too(folder):
    with h5py.File(folder / "scan.h5", "r+") as file:
        file["geometry"].create_group("more")["z"] = h5py.ExternalLink("secret.h5", "/counts")
    with pytest.raises(FileFormatError, match="/geometry/more/z is a link to another file"):
        read_scan(folder / "scan.h5")


def test_links_within_the_file_are_followed(folder):
    with h5py.File(folder / "scan.h5", "r+") as file:
        file.move("counts", "measured")
        file["counts"] = h5py.SoftLink("/measured")
        file["again"] = file["/"]  # a circle
    assert float(read_scan(folder / "scan.h5").counts.mean()) == 500.0


@pytest.mark.parametrize("length", [0, 2**64 - 16])
def test_texts_that_would_be_read_for_ever_are_refused(length, folder):
    """HDF5 goes from one object of its heap to the next by their lengths, and cannot be interrupted."""
    content = bytearray((folder / "scan.h5").read_bytes())
    at = content.index(b"GCOL") + 16
    content[at : at + 16] = bytes(8) + length.to_bytes(8, "little")
    (folder / "scan.h5").write_bytes(content)
    with pytest.raises(FileFormatError, match=r"this file is damaged .a text without its length"):
        read_scan(folder / "scan.h5")


def test_a_text_that_is_longer_than_its_file_is_refused(folder):
    """HDF5 would first give it memory: gigabytes, of a scan of a few kilobytes."""
    content = bytearray((folder / "scan.h5").read_bytes())
    assert content.count(_TEXT) > 10
    at = content.index(_TEXT) + len(_TEXT)
    content[at : at + 4] = (len(content) + 1).to_bytes(4, "little")
    (folder / "scan.h5").write_bytes(content)
    with pytest.raises(FileFormatError, match=r"this file is damaged .a text without its length"):
        read_scan(folder / "scan.h5")
