"""JSON that may come from anywhere, and the files that it names."""

import json
from pathlib import Path
from typing import Any

from pnpct.files.errors import FileFormatError, PathLike, existing_file, shown

_LARGEST = 1e15


def load_json(path: PathLike) -> dict[str, Any]:
    """Load a JSON file that holds an object.

    Raises:
        OSError: If there is no such file or it cannot be read.
        FileFormatError: If it is not JSON, or not an object.
    """
    try:
        return parse_json(existing_file(path).read_bytes())
    except FileFormatError as error:
        raise FileFormatError(f"{path}: {error}") from error


def parse_json(text: str | bytes) -> dict[str, Any]:
    """Read JSON that holds an object.

    Raises:
        FileFormatError: If it is not JSON, nested too deeply, or not an object.
    """
    try:
        content = json.loads(text)
    except RecursionError as error:
        raise FileFormatError("this is not JSON that can be read (its brackets are nested too deeply).") from error
    except ValueError as error:
        reason = "a number has thousands of digits" if "digits" in str(error) else error
        raise FileFormatError(f"this is not JSON ({reason}).") from error
    if not isinstance(content, dict):
        raise FileFormatError(f"a JSON object with named values was needed, got {shown(content)}.")
    return content


def check_numbers(content: object) -> None:
    """Check that no number in what JSON holds is one that nothing measured can have, and nobody could draw.

    Raises:
        FileFormatError: If there is one.
    """
    if isinstance(content, int | float) and not abs(content) <= _LARGEST:
        raise FileFormatError(f"it holds the number {shown(content)}")
    for each in content.values() if isinstance(content, dict) else content if isinstance(content, list) else ():
        check_numbers(each)


def file_beside(folder: Path, name: str) -> Path:
    """Return the path of a file that a description names, which must be in the description's folder or below.

    A description from elsewhere could otherwise have a private file read, and written out again.

    Args:
        folder: Where the description is.
        name: The file, from there.

    Raises:
        FileFormatError: If it is elsewhere, also by a symbolic link.
    """
    path = folder / name
    try:
        inside = path.resolve().is_relative_to(folder.resolve())
    except (OSError, RuntimeError, ValueError):  # a circle of links, a name too long or with a zero in it
        inside = False
    if not inside:
        raise FileFormatError(
            f"it names {shown(name)}, which is not in its own folder; copy that file there and name it without a path."
        )
    return path
