"""The package's own exception, and the check that a file is there."""

import os
from pathlib import Path

PathLike = str | os.PathLike[str]


class FileFormatError(ValueError):
    """A file is there, but its content is not what was needed."""


def existing_file(path: PathLike) -> Path:
    """Return the path of an ordinary file.

    Raises:
        FileNotFoundError: If there is no such file.
        IsADirectoryError: If it is a folder.
        OSError: If it is a pipe or a device, from which reading might never end.
    """
    path = Path(path)
    if path.is_dir():
        raise IsADirectoryError(f"{path} is a folder, but a file is needed.")
    if not path.exists():
        raise FileNotFoundError(f"There is no file {path}.")
    if not path.is_file():
        raise OSError(f"{path} is a pipe or a device, but an ordinary file is needed; save it as one first.")
    return path
