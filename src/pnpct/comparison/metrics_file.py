"""`metrics.json` in the folder of a comparison: its records, whose format version is checked when read."""

from pathlib import Path

import msgspec

from pnpct.comparison.schema import Comparison
from pnpct.files import FileFormatError, atomic_path
from pnpct.files.errors import shown
from pnpct.files.json_file import check_numbers, load_json

RESULTS = "metrics.json"
"""Name of the file in the folder of a comparison."""

FORMAT, FORMAT_VERSION = "pnpct-comparison", 2


def write_comparison(folder: Path, comparison: Comparison) -> None:
    """Write `metrics.json` into the folder of a comparison.

    Raises:
        OSError: If the file cannot be written.
    """
    content = {"format": FORMAT, "format_version": FORMAT_VERSION, **msgspec.to_builtins(comparison)}
    with atomic_path(folder / RESULTS) as temporary:
        temporary.write_bytes(msgspec.json.format(msgspec.json.encode(content), indent=1) + b"\n")


def read_comparison(folder: Path) -> Comparison:
    """Read `metrics.json` from the folder of a comparison.

    Raises:
        OSError: If there is none or it cannot be read.
        FileFormatError: If it is something else, or of another format version.
    """
    path = folder / RESULTS
    found = load_json(path)
    if found.pop("format", None) != FORMAT:
        raise FileFormatError(f"{path} is not what a comparison writes.")
    if (written := found.pop("format_version", None)) != FORMAT_VERSION:
        theirs = f"{path} has the format version {shown(written)}, and this pnpct reads {FORMAT_VERSION}"
        raise FileFormatError(f"{theirs}: make the comparison again, or read it with the pnpct that wrote it.")
    try:
        check_numbers(found)
        return msgspec.convert(found, Comparison)
    except ValueError as error:
        raise FileFormatError(f"{path} is not what a comparison writes: {str(error).rstrip('.')}.") from error
