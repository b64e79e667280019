"""Files and folders that are either complete or absent."""

import errno
import os
import re
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pnpct.files.errors import PathLike, resolved

_NO_ROOM = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}
_WRITTEN_IN_PART = re.compile(r"\d+ requested and \d+ written")
"""What numpy says of a full disk, without the system's number."""


@contextmanager
def atomic_path(path: PathLike) -> Iterator[Path]:
    """Give a temporary path in the folder of `path`; rename it to `path` when the block has succeeded.

    The temporary name ends like `path`, since libraries choose a format by the suffix. When the block ends,
    the content is flushed to the disk before the renaming; after any exception, KeyboardInterrupt included,
    the temporary file is removed and an older file under `path` is as it was. A symbolic link stays one: the
    file that it names is replaced.

    Args:
        path: File to write.

    Yields:
        The path to write to.

    Raises:
        OSError: If the folder is not there or cannot be written to, `path` is a folder, a device or
            write-protected, or the disk is full.

    Example:
        >>> import tempfile
        >>> folder = Path(tempfile.mkdtemp())
        >>> with atomic_path(folder / "note.txt") as temporary:
        ...     _ = temporary.write_text("all of it")
        >>> [file.name for file in folder.iterdir()]
        ['note.txt']
    """
    target = _writable_target(Path(path))
    temporary = target.with_name(f".{secrets.token_hex(4)}-{target.name[-200:]}")
    try:
        with _full_disk_said(path):
            yield temporary
            _flush_to_disk(temporary)
            temporary.replace(target)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
    _flush_to_disk(target.parent)


@contextmanager
def atomic_folder(path: PathLike) -> Iterator[Path]:
    """Give a new folder beside `path`; rename it to `path` when the block has succeeded.

    As with `atomic_path`, what is in it is flushed to the disk first; after any exception it is removed, and an
    older folder under `path` is as it was. Otherwise the older folder is removed, whatever is in it: the caller has
    looked.

    Args:
        path: Folder to write; the folder that it lies in must be there.

    Yields:
        The folder to fill with files.

    Raises:
        OSError: If the folder that it lies in is not there or cannot be written to, `path` is no folder, or the disk is
            full.

    Example:
        >>> import tempfile
        >>> series = Path(tempfile.mkdtemp()) / "series"
        >>> with atomic_folder(series) as temporary:
        ...     _ = (temporary / "note.txt").write_text("all of it")
        >>> [file.name for file in series.iterdir()]
        ['note.txt']
    """
    target = _writable_target(Path(path), folder=True)
    temporary, older = (target.with_name(f".{secrets.token_hex(4)}-{target.name[-200:]}") for _ in range(2))
    try:
        with _full_disk_said(path):
            temporary.mkdir()
            yield temporary
            for file in temporary.iterdir():
                _flush_to_disk(file)
            _flush_to_disk(temporary)
            if target.exists():
                target.rename(older)
            temporary.rename(target)
    except BaseException:
        shutil.rmtree(temporary, ignore_errors=True)
        if older.exists() and not target.exists():
            older.rename(target)
        raise
    shutil.rmtree(older, ignore_errors=True)
    _flush_to_disk(target.parent)


@contextmanager
def _full_disk_said(path: PathLike) -> Iterator[None]:
    try:
        yield
    except Exception as error:
        if _error_number(error) not in _NO_ROOM:
            raise
        full = OSError(f"{path} was not written: the disk is full, or a limit is reached.")
        full.errno = _error_number(error)
        raise full from error


def _writable_target(path: Path, *, folder: bool = False) -> Path:
    """The file or folder that `path` names once links are followed, checked before the work and not after it."""
    target = resolved(path)
    if not target.parent.is_dir():
        raise FileNotFoundError(f"{path} cannot be written: there is no folder {path.parent}; make it first.")
    if target.is_dir() and not folder:
        raise IsADirectoryError(f"{path} cannot be written: it is a folder; give the name of a file.")
    if target.is_symlink():
        raise OSError(f"{path} is a symbolic link that leads back to itself; remove it.")
    kind = "folder" if folder else "file"
    if target.exists() and not (target.is_dir() if folder else target.is_file()):
        raise OSError(f"{path} cannot be written: it is {'no folder' if folder else 'not an ordinary file'}.")
    if target.exists() and not os.access(target, os.W_OK):
        raise PermissionError(f"{path} cannot be written: the {kind} is write-protected.")
    if not os.access(target.parent, os.W_OK | os.X_OK):
        raise PermissionError(f"{path} cannot be written: the folder {path.parent} is not writable.")
    return target


def _error_number(error: Exception) -> int:
    """The system's number of an error, also where HDF5 and numpy have it in words only; 0 if there is none."""
    if isinstance(error, OSError) and error.errno is not None:
        return error.errno
    if isinstance(error, OSError) and _WRITTEN_IN_PART.fullmatch(str(error)):
        return errno.ENOSPC
    written = re.search(r"errno = (\d+)", str(error)) if isinstance(error, OSError | RuntimeError) else None
    return int(written.group(1)) if written else 0


def _flush_to_disk(path: Path) -> None:
    if path.is_dir() and os.name == "nt":
        return  # Windows cannot open folders, and needs no flush of them
    descriptor = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
