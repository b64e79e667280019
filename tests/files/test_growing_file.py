"""A file that never fails under the HDF5 library."""

import errno

import h5py
import numpy as np
import pytest

from pnpct.files.growing_file import GrowingFile


def test_hdf5_written_through_it_is_an_ordinary_file(tmp_path):
    with GrowingFile(tmp_path / "a.h5") as disk, h5py.File(disk, "w") as file:
        file["numbers"] = np.arange(5)
    with h5py.File(tmp_path / "a.h5") as file:
        assert file["numbers"][:].tolist() == [0, 1, 2, 3, 4]


def test_what_follows_a_failure_is_lost_and_the_failure_is_raised(tmp_path):
    resource = pytest.importorskip("resource", reason="this system has no limits to set")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    noise = np.random.default_rng(1).standard_normal((64, 100))
    with GrowingFile(tmp_path / "a.h5") as disk:
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, limits[1]))
        try:
            with h5py.File(disk, "w") as file:
                dataset = file.create_dataset("noise", (64, 100), float, chunks=(1, 100), compression="gzip")
                for row in range(64):
                    dataset[row] = noise[row]
                file.create_group("after")
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        with pytest.raises(OSError) as raised:  # noqa: PT011 - its number says which
            disk.raise_failure()
    assert raised.value.errno == errno.EFBIG


def test_nothing_is_raised_where_all_was_written(tmp_path):
    with GrowingFile(tmp_path / "a") as disk:
        assert disk.write(b"abc") == 3
        disk.raise_failure()
    assert (tmp_path / "a").read_bytes() == b"abc"
