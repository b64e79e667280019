"""The manifest of a data set: its scans, their patients, splits and files."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal, TypeAlias, get_args

from pnpct.files.atomic import atomic_path
from pnpct.files.errors import FileFormatError
from pnpct.files.json_file import file_beside, load_json

FORMAT = "pnpct-dataset"
MANIFEST = "manifest.json"
"""Name of the file that lists the scans of a data set."""

Split: TypeAlias = Literal["train", "validation", "test"]
"""Parts of a data set; a patient is in one of them."""

SPLITS: tuple[Split, ...] = get_args(Split)
"""Their names."""


@dataclass(frozen=True)
class ListedScan:
    """One axial scan of one patient.

    Args:
        name: Of the scan.
        source: An anatomy, or the path of the body that was scanned.
        patient: Index of the patient among those of its source.
        split: Training, validation or test, by patient.
        z_mm: Height of each detector row's slice, mm.
        files: SHA-256 of the file of exposures of each row, by its path in the data set.
    """

    name: str
    source: str
    patient: int
    split: Split
    z_mm: Sequence[float]
    files: Mapping[str, str]


@dataclass(frozen=True)
class Manifest:
    """What is in a data set.

    Args:
        recipe: All that the data set depends on, in plain values.
        scans: Its scans.
    """

    recipe: Mapping[str, Any]
    scans: Sequence[ListedScan]

    def files(self, split: Split) -> tuple[str, ...]:
        """Return the paths in the data set of all slices of one split."""
        return tuple(name for scan in self.scans if scan.split == split for name in scan.files)


def write_manifest(folder: Path, manifest: Manifest) -> None:
    """Write the manifest of a data set into its folder.

    Raises:
        OSError: If it cannot be written.
    """
    content = {"format": FORMAT, "format_version": 1, "pnpct": version("pnpct"), **asdict(manifest)}
    with atomic_path(folder / MANIFEST) as temporary:
        temporary.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def read_manifest(folder: Path) -> Manifest:
    """Read the manifest of a data set.

    Raises:
        OSError: If there is none or it cannot be read.
        FileFormatError: If it is not the manifest of a data set.
    """
    path = folder / MANIFEST
    content = load_json(path)
    if content.get("format") != FORMAT:
        raise FileFormatError(f"{path} is not the manifest of a data set.")
    number = content.get("format_version")
    if isinstance(number, int) and number > 1:
        raise FileFormatError(f"{path} is of a newer version; update pnpct.")
    try:
        scans = [ListedScan(**scan) for scan in content["scans"]]
        recipe = content["recipe"]
    except (KeyError, TypeError) as error:
        raise FileFormatError(f"{path} is not the complete manifest of a data set.") from error
    if not isinstance(recipe, dict) or not all(_plausible(scan) for scan in scans):
        raise FileFormatError(f"{path} is not the complete manifest of a data set.")
    try:
        for name in (name for scan in scans for name in scan.files):
            file_beside(folder, name)
    except FileFormatError as error:
        raise FileFormatError(f"{path}: {error}") from error
    return Manifest(recipe, scans)


def _plausible(scan: ListedScan) -> bool:
    return (
        isinstance(scan.name, str)
        and scan.split in SPLITS
        and isinstance(scan.files, dict)
        and isinstance(scan.z_mm, list)
        and len(scan.files) == len(scan.z_mm) > 0
        and all(isinstance(digest, str) for digest in scan.files.values())
    )
