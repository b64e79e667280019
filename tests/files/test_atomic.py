import errno
import os
import signal

import pytest
import torch

from pnpct.files import Provenance, atomic_folder, atomic_path, write_image
from pnpct.geometry import ImageGrid

resource = pytest.importorskip("resource", reason="this system has no limits to set")


@pytest.fixture
def little_room():
    """No file may grow beyond 20 kB."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, hard))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    signal.signal(signal.SIGXFSZ, handler)


def test_the_file_appears_under_its_name_and_nothing_else_does(tmp_path):
    with atomic_path(tmp_path / "image.nii.gz") as temporary:
        assert temporary.parent == tmp_path
        assert temporary.name.endswith("image.nii.gz")
        temporary.write_text("content")
        assert not (tmp_path / "image.nii.gz").exists()
    assert [file.name for file in tmp_path.iterdir()] == ["image.nii.gz"]
    assert (tmp_path / "image.nii.gz").read_text() == "content"


@pytest.mark.parametrize("exception", [RuntimeError, KeyboardInterrupt, SystemExit, GeneratorExit])
def test_an_exception_leaves_the_old_file_and_no_temporary_one(tmp_path, exception):
    path = tmp_path / "scan.h5"
    path.write_text("old")

    def interrupted():
        with atomic_path(path) as temporary:
            temporary.write_text("half of the n")
            raise exception("stop")

    with pytest.raises(exception, match="stop"):
        interrupted()
    assert [file.name for file in tmp_path.iterdir()] == ["scan.h5"]
    assert path.read_text() == "old"


def test_an_exception_before_anything_is_written_passes(tmp_path):
    with pytest.raises(KeyError), atomic_path(tmp_path / "a"):
        raise KeyError("early")
    assert list(tmp_path.iterdir()) == []


def test_a_missing_folder_is_named(tmp_path):
    message = r"there is no folder .*/absent; make it first"
    with pytest.raises(FileNotFoundError, match=message), atomic_path(tmp_path / "absent" / "scan.h5"):
        pass


def test_a_folder_cannot_be_overwritten(tmp_path):
    with pytest.raises(IsADirectoryError, match="give the name of a file"), atomic_path(tmp_path):
        pass


def test_a_device_is_not_replaced_by_a_file():
    message = "/dev/null cannot be written: it is not an ordinary file"
    with pytest.raises(OSError, match=message), atomic_path("/dev/null"):
        pass


def test_folders_and_files_without_permission_are_named(tmp_path, monkeypatch):
    path = tmp_path / "scan.h5"
    path.write_text("old")
    monkeypatch.setattr(os, "access", lambda where, mode: os.fspath(where) != os.fspath(path))
    with pytest.raises(PermissionError, match="the file is write-protected"), atomic_path(path):
        pass
    monkeypatch.setattr(os, "access", lambda where, mode: os.fspath(where) != os.fspath(tmp_path))
    with pytest.raises(PermissionError, match=r"the folder .* is not writable"), atomic_path(path):
        pass
    assert path.read_text() == "old"


def test_a_link_stays_a_link(tmp_path):
    (tmp_path / "real").mkdir()
    (tmp_path / "real" / "image.h5").write_text("old")
    link = tmp_path / "link.h5"
    link.symlink_to(tmp_path / "real" / "image.h5")
    with atomic_path(link) as temporary:
        temporary.write_text("new")
    assert link.is_symlink()
    assert (tmp_path / "real" / "image.h5").read_text() == "new"


@pytest.mark.parametrize(
    "error",
    [
        OSError(errno.ENOSPC, "No space left on device"),
        RuntimeError("Can't decrement id ref count (file write failed: errno = 28, error message = 'No space')"),
        OSError("Unable to close file (errno = 28, error message = 'No space left on device')"),
        OSError("4096 requested and 3040 written"),
    ],
)
def test_a_full_disk_is_one_sentence_that_names_the_file(tmp_path, error):
    path = tmp_path / "scan.h5"

    def fill_up():
        with atomic_path(path) as temporary:
            temporary.write_text("half")
            raise error

    with pytest.raises(OSError, match=f"^{path} was not written: the disk is full") as raised:
        fill_up()
    assert raised.value.errno == errno.ENOSPC
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("suffix", [".h5", ".nii", ".nii.gz", ".png"])
def test_running_out_of_room_ends_in_that_sentence(tmp_path, generator, little_room, suffix):
    path = tmp_path / f"image{suffix}"
    image = 1.0 + 0.15 * torch.randn(200, 200, generator=generator)
    with pytest.raises(OSError, match=f"^{path} was not written: the disk is full"):
        write_image(path, image, ImageGrid(200, 200, 1.0), provenance=Provenance(["pnpct"], "0.1.0"))
    assert list(tmp_path.iterdir()) == []


def fill(folder, **sizes: int):
    with atomic_folder(folder) as temporary:
        for name, size in sizes.items():
            (temporary / name).write_bytes(bytes(size))


@pytest.mark.parametrize("older", [False, True])
def test_a_full_disk_leaves_the_old_folder_or_none(tmp_path, little_room, older):
    if older:
        fill(tmp_path / "series", old=10)
    with pytest.raises(OSError, match="series was not written: the disk is full, or a limit is reached"):
        fill(tmp_path / "series", first=10, second=30_000)
    assert [path.name for path in sorted(tmp_path.rglob("*"))] == (["series", "old"] if older else [])


def test_a_folder_replaces_a_folder_as_a_whole(tmp_path):
    fill(tmp_path / "series", old=10)
    fill(tmp_path / "series", new=10)
    assert [path.name for path in sorted(tmp_path.rglob("*"))] == ["series", "new"]
    with pytest.raises(FileNotFoundError, match="make it first"):
        fill(tmp_path / "absent" / "series", new=10)
