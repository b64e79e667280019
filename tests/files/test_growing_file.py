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
    try:
        with pytest.raises(OSError) as raised, GrowingFile(tmp_path / "a.h5") as disk:  # noqa: PT011, PT012 - by its number
            resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, limits[1]))
            with h5py.File(disk, "w") as file:
                dataset = file.create_dataset("noise", (64, 100), float, chunks=(1, 100), compression="gzip")
                for row in range(64):
                    dataset[row] = noise[row]
                file.create_group("after")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert raised.value.errno == errno.EFBIG


def test_nothing_is_raised_where_all_was_written(tmp_path):
    with GrowingFile(tmp_path / "a") as disk:
        assert disk.write(b"abc") == 3
    assert (tmp_path / "a").read_bytes() == b"abc"


@pytest.mark.parametrize("error", [OSError("HDF5 cannot read what is not there"), KeyboardInterrupt()])
def test_a_failure_takes_the_place_of_errors_that_come_of_it(tmp_path, monkeypatch, error):
    def fill():
        with GrowingFile(tmp_path / "a") as disk:
            monkeypatch.setattr(disk, "_failure", OSError(errno.ENOSPC, "No space left on device"))
            raise error

    with pytest.raises(OSError if isinstance(error, OSError) else KeyboardInterrupt) as raised:
        fill()
    assert getattr(raised.value, "errno", errno.ENOSPC) == errno.ENOSPC
