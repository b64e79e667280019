"""Tables of a page."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from pnpct.report.marked_numbers import Numbers
from pnpct.report.results import Results
from pnpct.report.words import common_decimals, title_of, unit_of

Cell = str
"""Text, or markup that is written as it is."""

TIME = "Time, beside other work on the same processor"
"""Cases are compared side by side, so their times are no measurement."""


@dataclass(frozen=True)
class Head:
    """The head of a column: its title, its unit, whether words are below it instead of numbers, and its colour."""

    title: str
    unit: str = ""
    words: bool = False
    style: str = ""


@dataclass(frozen=True)
class Row:
    """A row: what it is about, its cells, the class of its colour, and the unit of its numbers."""

    label: str
    cells: tuple[Cell, ...]
    style: str = ""
    unit: str = ""


@dataclass(frozen=True)
class Table:
    """A table with its caption; the first column is the heads of the rows."""

    caption: str
    heads: tuple[Head, ...]
    rows: tuple[Row, ...]


def case_tables(results: Results, part: str) -> tuple[Table, ...]:
    """Return a table for each case that a part of the comparison has: numbers below each other, methods as columns.

    Args:
        results: The comparison.
        part: "fidelity" (then with the time that each image took), "texture" or "histogram".
    """
    tables, numbers = [], results.numbers
    for place, case in enumerate(results.comparison.cases):
        of_case: Mapping[str, Mapping[str, float | None]] = getattr(results.comparison, part).get(case.name, {})
        found = {method: label for method, label in results.labels.items() if method in of_case}
        names = dict.fromkeys(name for row in of_case.values() for name in row)
        rows = [_row(numbers, [(part, case.name, method, name) for method in found], name) for name in names]
        if names and part == "fidelity" and any(image.seconds is not None for image in case.images.values()):
            paths = [("cases", place, "images", method, "seconds") for method in found]
            rows.append(replace(_row(numbers, paths, "time_s"), label=TIME))
        if rows:
            heads = tuple(Head(label, style=results.styles[method]) for method, label in found.items())
            tables.append(Table(f"{title_of(part)}: {case.label}", heads, tuple(rows)))
    return tuple(tables)


def _row(numbers: Numbers, paths: Sequence[tuple[str | int, ...]], name: str) -> Row:
    """One number of all methods, all to the same digit where that serves them."""
    decimals = common_decimals(numbers.find(*path) for path in paths)
    return Row(title_of(name), tuple(numbers(*path, decimals=decimals) for path in paths), unit=unit_of(name))
