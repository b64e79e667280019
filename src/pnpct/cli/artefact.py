"""The one file that a command writes, and its sidecar."""

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from pnpct.arrays import Image
from pnpct.cli.terminal import say
from pnpct.files import Provenance, atomic_path, write_scan, write_sidecar
from pnpct.files.errors import resolved
from pnpct.geometry import ImageGrid
from pnpct.physics import Scan

SCANS = (".h5",)
IMAGES = (".h5", ".nii", ".nii.gz", ".png")
NUMBERS = (".json",)
PICTURES = (".png",)


class _WritableError(Exception):
    pass


def check_output(path: Path, suffixes: Sequence[str], *, inputs: Sequence[Path] = ()) -> None:
    """Find out before the work, not after it, whether an artefact can be written.

    Args:
        path: Its path; its sidecar is <path>.json.
        suffixes: The endings that its name may have.
        inputs: Files that it must not replace.

    Raises:
        ValueError: If the name has another ending, or is that of an input.
        OSError: If the file or its sidecar cannot be written.
    """
    if not path.name.lower().endswith(tuple(suffixes)):
        raise ValueError(f"{path}: the name of the output must end in {', '.join(suffixes)}.")
    sidecar = path.with_name(path.name + ".json")
    for target in (path, sidecar):
        for source in inputs:
            if source.exists() and resolved(target) == resolved(source):
                raise ValueError(f"{target} is an input and would be replaced; choose another name for the output.")
        with suppress(_WritableError), atomic_path(target):
            raise _WritableError  # it has checked the path; nothing is written yet


def finish(path: Path, provenance: Provenance, *, summary: str) -> None:
    """Write the sidecar of an artefact that has just been written, and print where it is.

    Raises:
        OSError: If the sidecar cannot be written.
    """
    write_sidecar(path, provenance)
    say(f"Wrote {path}: {summary}.")


def finish_scan(
    path: Path, scan: Scan, *, provenance: Provenance, truth: tuple[Image, ImageGrid] | None = None
) -> None:
    """Write a scan and its sidecar, and print where it is.

    Raises:
        OSError: If a file cannot be written.
    """
    write_scan(path, scan, provenance=provenance, truth=truth)
    finish(path, provenance, summary=f"{scan.geometry}{', and the truth' if truth else ''}")
