"""The package's own exception, and the check that a file is there."""

import difflib
import os
from itertools import islice
from pathlib import Path

_LONGEST = 80
_MOST_NAMES = 1000

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
    if path.is_symlink() and not path.exists():
        raise FileNotFoundError(f"{path} is a symbolic link that leads to no file; give the file itself.")
    if not path.exists():
        raise FileNotFoundError(f"There is no file {path}{_near(path)}.")
    if not path.is_file():
        raise OSError(f"{path} is a pipe or a device, but an ordinary file is needed; save it as one first.")
    return path


def _near(path: Path) -> str:
    """The name in the folder of a path that may have been meant."""
    if not path.parent.is_dir():
        return ""
    names = [found.name for found in islice(path.parent.iterdir(), _MOST_NAMES)]
    near = difflib.get_close_matches(path.name, names, n=1)
    return f"; there is {near[0]}" if near else ""


def resolved(path: PathLike) -> Path:
    """Return the path that a path leads to, once links are followed.

    Raises:
        OSError: If links lead around in a circle.
    """
    try:
        return Path(path).resolve()
    except RuntimeError as error:  # as Python before 3.13 says it
        raise OSError(f"{path} is a symbolic link that leads back to itself; remove it.") from error


def shown(value: object) -> str:
    """Return what a value looks like in an error, cut where it is long.

    Example:
        >>> len(shown("m" * 100_000)), shown([1.5, "two", None, 4])
        (80, "[1.5, 'two', None, ...]")
    """
    if isinstance(value, int):  # Python refuses to write thousands of digits
        return str(value) if abs(value) < 10**_LONGEST else f"a number of {value.bit_length()} bits"
    if isinstance(value, str | bytes):
        value = value[: _LONGEST + 1]
    elif isinstance(value, list | tuple):
        return f"[{', '.join(map(shown, value[:3]))}{', ...' if len(value) > 3 else ''}]"[: 2 * _LONGEST]
    elif isinstance(value, dict):
        return f"an object with {len(value)} names"
    text = repr(value)
    return text if len(text) < _LONGEST else text[: _LONGEST - 3] + "..."
