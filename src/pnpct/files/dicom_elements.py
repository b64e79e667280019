"""What DICOM files are made of: elements by name, codes, decimal numbers and UIDs."""

import re
from collections.abc import Mapping
from typing import Any
from uuid import NAMESPACE_DNS, uuid5

from pydicom import Dataset
from pydicom.uid import UID
from pydicom.valuerep import format_number_as_ds

from pnpct.files.errors import shown

_NAMESPACE = uuid5(NAMESPACE_DNS, "pnpct")

_ROUNDING = 1e-12
"""Of a length in mm, in the last digits of a sum."""

WRITER = UID(f"2.25.{_NAMESPACE.int}")
"""Implementation that wrote a file: pnpct."""


def dataset_of(elements: Mapping[str, Any]) -> Dataset:
    """Return a data set with these elements, by keyword."""
    dataset = Dataset()
    for name, value in elements.items():
        setattr(dataset, name, value)
    return dataset


def code(value: str, meaning: str) -> Dataset:
    """Return the item of a code that DICOM itself defines (PS3.16, Annex D)."""
    return dataset_of({"CodeValue": value, "CodingSchemeDesignator": "DCM", "CodeMeaning": meaning})


def decimal(number: float) -> str:
    """Return a number in at most 16 characters, all that DICOM has for one.

    Example:
        >>> decimal(1000 / 3), decimal(0.1 + 0.2)
        ('333.333333333333', '0.3')
    """
    short = round(number, 9) + 0.0
    return format_number_as_ds(short if abs(short - number) < _ROUNDING else float(number))


def uid_of(*words: str) -> UID:
    """Return the UID that follows from these words: the same words have the same one, for ever.

    References:
        DICOM PS3.5, B.2.
    """
    return UID(f"2.25.{uuid5(_NAMESPACE, chr(10).join(words)).int}")


def body_part_code(name: str) -> str:
    """Return a body part as DICOM writes it, in capitals.

    Raises:
        ValueError: If it is longer than 16 characters, or there are others than letters, digits and spaces.
    """
    code = name.strip().upper()
    if not re.fullmatch(r"[A-Z0-9 _]{1,16}", code):
        raise ValueError(f"A body part is 1 to 16 letters, digits and spaces, such as CHEST, got {shown(name)}.")
    return code
