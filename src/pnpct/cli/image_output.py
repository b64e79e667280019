"""The image that a command writes: a file, or a folder with a series of CT images in DICOM."""

from collections.abc import Sequence
from pathlib import Path

from pnpct.arrays import Image, Volume
from pnpct.cli.artefact import IMAGES, check_output, finish
from pnpct.files import (
    Provenance,
    SourceSeries,
    body_part_code,
    check_replaceable,
    describe_file,
    write_dicom_series,
    write_image,
)
from pnpct.files.errors import resolved
from pnpct.geometry import Grid
from pnpct.simulation import ANATOMIES

BODY_PARTS = tuple(name.upper() for name in ANATOMIES)


def names_folder(path: Path, command: Sequence[str]) -> bool:
    """Return whether an output is a folder: it has no suffix, was written with a slash, or is there as one."""
    slash = any(word.endswith("/") and Path(word) == path for word in command)
    return slash or not path.suffix or (path.is_dir() and not path.name.lower().endswith(IMAGES))


def body_part_of(scan: Path) -> str | None:
    """Return the body part of the simulated patient in a scan, None if it is not known.

    Raises:
        OSError: If the scan cannot be read.
        ValueError: If it is not one of pnpct's files.
    """
    known = describe_file(scan)["provenance"]["settings"].get("body_part")
    return known if isinstance(known, str) and known in BODY_PARTS else None


def check_image_output(
    path: Path, command: Sequence[str], *, inputs: Sequence[Path], body_part: str | None = None
) -> None:
    """Find out before the work, not after it, whether an image can be written.

    Args:
        path: Its path; its sidecar is <path>.json.
        command: The command line, word by word.
        inputs: Files and folders that it must not replace.
        body_part: Body part for a DICOM series, if it was given.

    Raises:
        ValueError: If the name has another ending, or is that of an input, or a body part is given for a file.
        OSError: If the file, the folder or the sidecar cannot be written.
    """
    if not names_folder(path, command):
        if body_part is not None:
            raise ValueError(f"--body-part is for DICOM series, and {path} is a file; leave it out, or name a folder.")
        check_output(path, IMAGES, inputs=inputs)
        return
    for source in inputs:
        if source.exists() and resolved(path) == resolved(source):
            raise ValueError(f"{path} is an input and would be replaced; choose another name for the output.")
    check_output(path.with_name(path.name + ".json"), (".json",), inputs=inputs)
    check_replaceable(path)
    if body_part is not None:
        body_part_code(body_part)


def finish_image(
    path: Path,
    image: Image | Volume,
    place: Grid | SourceSeries,
    *,
    provenance: Provenance,
    body_part: str | None = None,
) -> None:
    """Write an image and its sidecar, and print where it is.

    Args:
        path: File, or folder for a DICOM series.
        image: The image or volume.
        place: Where its pixels are, or for a DICOM series the one that it was made of.
        provenance: How it was made; its command line says whether the path is a folder.
        body_part: Body part for a DICOM series.

    Raises:
        OSError: If a file cannot be written.
        ValueError: If the format cannot hold the image.
    """
    if isinstance(place, SourceSeries) or names_folder(path, provenance.command):
        write_dicom_series(path, image, place, provenance=provenance, body_part=body_part)
        of = "its source's patient and study" if isinstance(place, SourceSeries) else "a fictitious patient"
        finish(path, provenance, summary=f"{place}, as a DICOM series of {of}")
        return
    write_image(path, image, place, provenance=provenance)
    finish(path, provenance, summary=str(place))
