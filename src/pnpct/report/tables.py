"""Tables of a page."""

from collections.abc import Sequence
from dataclasses import dataclass

from pnpct.comparison import Comparison
from pnpct.report.images import labels
from pnpct.report.marked_numbers import Numbers
from pnpct.report.words import common_decimals, title_of, unit_of

Cell = str
"""Text, or markup that is written as it is."""


@dataclass(frozen=True)
class Head:
    """The head of a column: its title, its unit, and whether words are below it instead of numbers."""

    title: str
    unit: str = ""
    words: bool = False


@dataclass(frozen=True)
class Row:
    """A row: what it is about, its cells, and the class of its colour."""

    label: str
    cells: tuple[Cell, ...]
    style: str = ""


@dataclass(frozen=True)
class Table:
    """A table with its caption; the first column is the heads of the rows."""

    caption: str
    heads: tuple[Head, ...]
    rows: tuple[Row, ...]


def case_tables(comparison: Comparison, numbers: Numbers, part: str, styles: dict[str, str]) -> tuple[Table, ...]:
    """Return a table for each case that a part of the comparison has: methods below each other.

    Args:
        comparison: The comparison.
        numbers: Its numbers.
        part: "fidelity" (then with the time that each image took), "texture" or "histogram".
        styles: Classes of the methods.
    """
    tables = []
    for place, case in enumerate(comparison.cases):
        of_case = numbers.find(part, case.name)
        if of_case:
            times = part == "fidelity" and any(image.seconds is not None for image in case.images.values())
            names = _names([*of_case.values()])
            decimals = {name: common_decimals(row.get(name) for row in of_case.values()) for name in names}
            rows = tuple(
                Row(
                    label,
                    (
                        *(numbers(part, case.name, method, name, decimals=decimals[name]) for name in names),
                        *([numbers("cases", place, "images", method, "seconds")] if times else []),
                    ),
                    styles[method],
                )
                for method, label in labels(comparison).items()
                if method in of_case
            )
            heads = [*(Head(title_of(name), unit_of(name)) for name in names), *([Head("Time", "s")] if times else [])]
            tables.append(Table(case.label, tuple(heads), rows))
    return tuple(tables)


def _names(rows: Sequence[dict[str, float | None]]) -> list[str]:
    """All names of numbers, in the order in which they first come."""
    return [*dict.fromkeys(name for row in rows for name in row)]
