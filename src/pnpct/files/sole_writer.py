"""One writer at a time for what is written bit by bit, and resumed after a kill."""

import os
import re
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pnpct.files.errors import PathLike, resolved

if sys.platform != "win32":
    import fcntl

_TEMPORARY = re.compile(r"\.[0-9a-f]{8}-(.+)")
"""The names that `atomic_path` and `atomic_folder` give."""


@contextmanager
def sole_writer(path: PathLike) -> Iterator[None]:
    """Keep other processes from writing the same, and remove the temporary files that killed ones have left.

    Workers of this process may write; those that it has terminated have left such files too. The claim ends with the
    process, however that ends. On Windows, and on file systems without locks, there is none.

    Args:
        path: A folder that is there, for all below it and itself; or a file or folder that may come, for what has its
            stem, or its name and a suffix, beside it.

    Raises:
        BlockingIOError: If another process writes there.
        OSError: If the folder cannot be read.

    Example:
        >>> import tempfile
        >>> folder = Path(tempfile.mkdtemp())
        >>> (folder / ".0123abcd-scan.h5").touch()
        >>> with sole_writer(folder):
        ...     list(folder.iterdir())
        []
    """
    path = resolved(path)
    claimed = path if path.is_dir() else path.with_name(f".{path.name}.lock")
    with _claim(claimed, path):
        _remove_unfinished(path)
        try:
            yield
        finally:
            _remove_unfinished(path)
            if claimed != path:
                claimed.unlink(missing_ok=True)


def _remove_unfinished(path: Path) -> None:
    for file in path.rglob(".*") if path.is_dir() else ():
        if _TEMPORARY.fullmatch(file.name):
            file.unlink(missing_ok=True)
    for file in path.parent.glob(".*"):
        temporary = _TEMPORARY.fullmatch(file.name)
        if not temporary or not (Path(temporary[1]).stem == path.stem or temporary[1].startswith(f"{path.name}.")):
            continue
        if file.is_dir():
            shutil.rmtree(file, ignore_errors=True)
        else:
            file.unlink(missing_ok=True)


@contextmanager
def _claim(claimed: Path, path: Path) -> Iterator[None]:
    if sys.platform == "win32":
        yield
        return
    descriptor = os.open(claimed, os.O_RDONLY if claimed.is_dir() else os.O_RDWR | os.O_CREAT, 0o644)
    try:
        if not _locked(descriptor):
            raise BlockingIOError(
                f"{path} is being written by another process; wait until it has ended, or choose another name."
            )
        yield
    finally:
        os.close(descriptor)


def _locked(descriptor: int) -> bool:
    """Whether nobody else has the lock; where the file system has no locks, nobody has."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return True
    return True
