"""Where an artefact comes from: the command, the version, the seed and the inputs' fingerprints."""

import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from importlib.metadata import version
from pathlib import Path
from typing import Any

from pnpct.files.atomic import atomic_path
from pnpct.files.errors import FileFormatError, PathLike, existing_file
from pnpct.files.json_file import parse_json


@dataclass(frozen=True)
class Provenance:
    """How an artefact was made.

    It has no clock: the same command with the same seed has the same provenance.

    Args:
        command: The command line, word by word.
        version: Version of pnpct.
        seed: Seed of the random numbers, None if there were none.
        inputs: SHA-256 of each input file or folder, in hexadecimal, by its name.
        settings: Whatever else is worth recording, in plain values: numbers, strings, lists, dictionaries.

    Raises:
        ValueError: If an entry of `inputs` is not a SHA-256, or `settings` cannot be written as JSON.

    Example:
        >>> Provenance(["pnpct", "simulate"], "0.1.0", seed=7).seed
        7
    """

    command: Sequence[str]
    version: str
    seed: int | None = None
    inputs: Mapping[str, str] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "command", list(self.command))
        object.__setattr__(self, "inputs", dict(self.inputs))
        try:
            # Through JSON and back, so that what is read is equal to what was written (tuples become lists).
            settings = json.loads(json.dumps(dict(self.settings), allow_nan=False))
        except (TypeError, ValueError) as error:
            raise ValueError(f"The settings of a provenance must be plain, finite values: {error}.") from error
        object.__setattr__(self, "settings", settings)
        for name, digest in self.inputs.items():
            if not re.fullmatch(r"[0-9a-f]{64}", digest):
                raise ValueError(f"The fingerprint of {name} must be a SHA-256 in hexadecimal, got {digest!r}.")

    def to_json(self) -> str:
        """Write the provenance as JSON, one key per line."""
        return json.dumps(asdict(self), indent=1, ensure_ascii=False) + "\n"

    @staticmethod
    def from_json(text: str) -> "Provenance":
        """Read what `to_json` wrote.

        Raises:
            FileFormatError: If the text is not JSON, or its keys or values are not those of a provenance.
        """
        try:
            content = parse_json(text)
        except FileFormatError as error:
            raise FileFormatError(f"A provenance is written in JSON: {error}") from error
        names = {entry.name for entry in fields(Provenance)}
        if set(content) != names:
            raise FileFormatError(f"A provenance has the keys {', '.join(sorted(names))}, got {_brief(content)}.")
        of_type = {
            "command": list,
            "version": str,
            "seed": int | None,
            "inputs": dict,
            "settings": dict,
        }
        for name, kind in of_type.items():
            if not isinstance(content[name], kind):
                raise FileFormatError(f"The provenance's {name} cannot be {_brief(content[name])}.")
        if not all(isinstance(word, str) for word in (*content["command"], *content["inputs"].values())):
            raise FileFormatError("The command and the fingerprints of a provenance are made of strings.")
        try:
            return Provenance(**content)
        except ValueError as error:
            raise FileFormatError(str(error)) from error


def record_run(
    command: Sequence[str],
    *,
    inputs: Sequence[PathLike] = (),
    seed: int | None = None,
    settings: Mapping[str, Any] | None = None,
) -> Provenance:
    """Return the provenance of a run that happens now: takes the fingerprints and the version.

    Args:
        command: The command line, word by word.
        inputs: The files and folders that are read.
        seed: Seed of the random numbers, None if there are none.
        settings: Further plain values worth recording.

    Raises:
        OSError: If an input cannot be read.
    """
    fingerprints = {str(path): sha256_of_folder(path) if Path(path).is_dir() else sha256_of(path) for path in inputs}
    return Provenance(command, version("pnpct"), seed=seed, inputs=fingerprints, settings=settings or {})


def sha256_of(path: PathLike) -> str:
    """Return the SHA-256 of a file's content in hexadecimal.

    Raises:
        OSError: If there is no such file, or it cannot be read.
    """
    with existing_file(path).open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def sha256_of_files(paths: Sequence[Path]) -> str:
    """Return the SHA-256 of the names and contents of several files, in hexadecimal.

    Raises:
        OSError: If one cannot be read.
    """
    return hashlib.sha256("".join(f"{path.name} {sha256_of(path)}\n" for path in paths).encode()).hexdigest()


def sha256_of_folder(path: PathLike) -> str:
    """Return the SHA-256 of the names and contents of the files in a folder, in hexadecimal.

    Raises:
        OSError: If there is no such folder, or a file cannot be read.
    """
    return sha256_of_files(sorted(file for file in Path(path).iterdir() if file.is_file()))


def write_sidecar(artefact_path: PathLike, provenance: Provenance) -> Path:
    """Write the provenance beside an artefact, as <artefact>.json, and return where.

    Raises:
        OSError: If the file cannot be written.
    """
    path = Path(artefact_path)
    path = path.with_name(path.name + ".json")
    with atomic_path(path) as temporary:
        temporary.write_text(provenance.to_json(), encoding="utf-8")
    return path


def _brief(value: object) -> str:
    text = ", ".join(sorted(value)) if isinstance(value, dict) else repr(value)
    return text if len(text) < 80 else text[:77] + "..."
