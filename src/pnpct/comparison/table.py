"""`metrics.csv`: every number of a comparison as one long table."""

import csv
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import msgspec

from pnpct.comparison.schema import Comparison
from pnpct.files import atomic_path

TABLE = "metrics.csv"
"""Name of the file in the folder of a comparison."""

COLUMNS = ("group", "case", "method", "of", "name", "value", "path")

_GIVEN = ("reference", "repeat", "truth")
_NOT_SAID = ("case", "method", "says", "file", "sha256", "label", "geometry")
"""Words of a record that have their own column, or say nothing about its numbers."""


def write_table(folder: Path, comparison: Comparison) -> None:
    """Write `metrics.csv`: a row for each number of `metrics.json`, and one without value for each that does not exist.

    The columns are the number's group, the case and the method that it is about, what else (lesion, observer, feature,
    tube current), its name, itself with all its digits, and its place in `metrics.json` as a JSON pointer.

    Raises:
        OSError: If the file cannot be written.
    """
    methods = frozenset({*(method.name for method in comparison.methods), *_GIVEN})
    walk = _Walk(frozenset(case.name for case in comparison.cases), methods)
    with atomic_path(folder / TABLE) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(COLUMNS)
        for group, content in msgspec.to_builtins(comparison).items():
            rows.writerows(walk.rows(content, _Place((group,))))


@dataclass(frozen=True)
class _Place:
    """Where in the file, and what the numbers there are about."""

    path: tuple[str | int, ...]
    case: str = ""
    method: str = ""
    of: tuple[str, ...] = ()
    name: tuple[str, ...] = ()

    @property
    def described(self) -> bool:
        """Whether names of cases and methods mean these here."""
        return self.path[0] not in ("provenance", "definitions")


@dataclass(frozen=True)
class _Walk:
    cases: frozenset[str]
    methods: frozenset[str]

    def rows(self, content: Any, place: _Place) -> Iterator[tuple[object, ...]]:
        """The numbers below a place."""
        if isinstance(content, Mapping):
            for key, value in content.items():
                yield from self.rows(value, self._below(place, key))
        elif isinstance(content, list | tuple):
            for index, value in enumerate(content):
                yield from self.rows(value, self._item(place, index, value))
        elif content is None or (isinstance(content, int | float) and not isinstance(content, bool)):
            path = "".join("/" + str(key).replace("~", "~0").replace("/", "~1") for key in place.path)
            value = "" if content is None else content
            yield place.path[0], place.case, place.method, ", ".join(place.of), " ".join(place.name), value, path

    def _below(self, place: _Place, key: str) -> _Place:
        there = replace(place, path=(*place.path, key))
        if place.described and not place.case and key in self.cases:
            return replace(there, case=key)
        if place.described and not place.method and key in self.methods:
            return replace(there, method=key)
        return replace(there, name=(*place.name, key))

    def _item(self, place: _Place, index: int, value: Any) -> _Place:
        """A record is named by its words and its tube current, anything else by its number."""
        there = replace(place, path=(*place.path, index))
        record = value if isinstance(value, Mapping) else {}
        if place.path == ("cases",):
            return replace(there, case=record["name"])
        if place.path == ("methods",):
            return replace(there, method=record["name"])
        words = [word for key, word in record.items() if isinstance(word, str) and key not in _NOT_SAID]
        if record.get("tube_current_ma") is not None:
            words.append(f"{record['tube_current_ma']:g} mA")
        if not words:
            return replace(there, name=(*place.name, str(index)))
        case, method = record.get("case") or place.case, record.get("method")
        # The method of a change of features is its number, and stands above it by name.
        method = method if isinstance(method, str) else place.method
        return replace(there, case=case, method=method, of=(*place.of, *words))
