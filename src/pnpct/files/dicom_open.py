"""DICOM files, also those that begin with their content at once, without the preamble of 128 bytes."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydicom import FileDataset, dcmread
from pydicom.errors import InvalidDicomError
from pydicom.pixels.utils import pixel_array
from pydicom.uid import ExplicitVRLittleEndian, ImplicitVRLittleEndian

_PREAMBLE = 128
_FIRST_GROUPS = (b"\x02\x00", b"\x08\x00")


def dcmread_any(path: Path, **options: Any) -> FileDataset:
    """Read a DICOM file, with or without preamble.

    Args:
        path: The file.
        **options: As for `pydicom.dcmread`.

    Raises:
        OSError: If the file cannot be read.
        InvalidDicomError: If it is no DICOM file, or says not even what it is.
        Exception: Of many kinds, if it is damaged.
    """
    if not begins_at_once(path):
        return dcmread(path, **options)
    tags = options.pop("specific_tags", None)
    header = dcmread(path, force=True, specific_tags=None if tags is None else [*tags, "SOPClassUID"], **options)
    if not header.get("SOPClassUID"):
        raise InvalidDicomError(f"{path} has no preamble, and does not say what it is.")
    if "TransferSyntaxUID" not in header.file_meta:
        implicit = header.original_encoding[0]
        header.file_meta.TransferSyntaxUID = ImplicitVRLittleEndian if implicit else ExplicitVRLittleEndian
    return header


def begins_at_once(path: Path) -> bool:
    """Return whether a file has no preamble, and begins as the content of one can: with the first groups."""
    with path.open("rb") as file:
        first = file.read(_PREAMBLE + 4)
    return first[_PREAMBLE:] != b"DICM" and first[:2] in _FIRST_GROUPS


def stored_pixels(path: Path, frame: int | None) -> NDArray[Any]:
    """Read the pixels as they are stored.

    Args:
        path: The file.
        frame: Which of several frames, from 0; None for the only one.

    Raises:
        OSError: If the file cannot be read.
        Exception: Of many kinds, if it is damaged or cannot be decoded.
    """
    pixels = pixel_array(dcmread_any(path) if begins_at_once(path) else path, index=frame)
    return np.asarray(pixels)
