"""Files that are either complete or absent."""

import errno
import os
import re
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pnpct.files.errors import PathLike, resolved

_NO_ROOM = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}


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
        yield temporary
        _flush_to_disk(temporary)
        temporary.replace(target)
    except BaseException as error:
        temporary.unlink(missing_ok=True)
        if isinstance(error, Exception) and _error_number(error) in _NO_ROOM:
            full = OSError(f"{path} was not written: the disk is full, or a limit is reached.")
            full.errno = _error_number(error)
            raise full from error
        raise
    _flush_to_disk(target.parent)


def _writable_target(path: Path) -> Path:
    """The file that `path` names once links are followed, checked before the work and not after it."""
    target = resolved(path)
    if not target.parent.is_dir():
        raise FileNotFoundError(f"{path} cannot be written: there is no folder {path.parent}; make it first.")
    if target.is_dir():
        raise IsADirectoryError(f"{path} cannot be written: it is a folder; give the name of a file.")
    if target.is_symlink():
        raise OSError(f"{path} is a symbolic link that leads back to itself; remove it.")
    if target.exists() and not target.is_file():
        raise OSError(f"{path} cannot be written: it is not an ordinary file.")
    if target.exists() and not os.access(target, os.W_OK):
        raise PermissionError(f"{path} cannot be written: the file is write-protected.")
    if not os.access(target.parent, os.W_OK | os.X_OK):
        raise PermissionError(f"{path} cannot be written: the folder {path.parent} is not writable.")
    return target


def _error_number(error: Exception) -> int:
    """The system's number of an error, also where HDF5 has it in its text only; 0 if there is none."""
    if isinstance(error, OSError) and error.errno is not None:
        return error.errno
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
