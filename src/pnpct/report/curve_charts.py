"""Noise power and transfer over frequency."""

from collections.abc import Mapping

from pnpct.comparison import Comparison, Curve
from pnpct.report.axes import fitted
from pnpct.report.charts import ACROSS, UP, Line, LineChart, Point, listed
from pnpct.report.images import labels
from pnpct.report.marked_numbers import Numbers
from pnpct.report.tables import Head, Row, Table
from pnpct.report.words import title_of, unit_of

_TITLES = {"noise-power": "Noise power", "transfer": "Transfer"}
_UNITS = {"noise-power": "noise power, HU² mm²", "transfer": "transfer"}


def curve_charts(comparison: Comparison, numbers: Numbers, styles: Mapping[str, str]) -> tuple[LineChart, ...]:
    """Return a chart for each kind of curve and each object that it was measured on."""
    return tuple(_chart(comparison, numbers, styles, kind, what) for kind, what in _groups(comparison))


def curve_tables(comparison: Comparison, numbers: Numbers, styles: Mapping[str, str]) -> tuple[Table, ...]:
    """Return the numbers that were taken from the curves, a table for each chart."""
    tables = []
    for kind, what in _groups(comparison):
        of_group = _curves(comparison, kind, what)
        names = [*dict.fromkeys(name for _, curve in of_group for name in curve.summary)]
        rows = tuple(
            Row(
                labels(comparison).get(curve.method, curve.method),
                tuple(numbers("curves", index, "summary", name) for name in names),
                styles.get(curve.method, ""),
            )
            for index, curve in of_group
        )
        if names:
            heads = tuple(Head(title_of(name), unit_of(name)) for name in names)
            tables.append(Table(f"{_TITLES[kind]}: {what}", heads, rows))
    return tuple(tables)


def _groups(comparison: Comparison) -> list[tuple[str, str]]:
    found = dict.fromkeys((curve.kind, curve.what) for curve in comparison.curves)
    return sorted(found, key=lambda group: group[0])


def _curves(comparison: Comparison, kind: str, what: str) -> list[tuple[int, Curve]]:
    return [(n, curve) for n, curve in enumerate(comparison.curves) if (curve.kind, curve.what) == (kind, what)]


def _chart(comparison: Comparison, numbers: Numbers, styles: Mapping[str, str], kind: str, what: str) -> LineChart:
    of_group = _curves(comparison, kind, what)
    x = fitted((f for _, curve in of_group for f in curve.frequency_per_mm), ACROSS, title="frequency, 1/mm")
    y = fitted((value for _, curve in of_group for value in curve.values), UP, title=_UNITS[kind])
    names = labels(comparison)
    lines = tuple(
        Line(
            label=names.get(curve.method, curve.method),
            style=styles.get(curve.method, ""),
            points=tuple(
                Point(x.at(f), y.at(value)) for f, value in zip(curve.frequency_per_mm, curve.values, strict=True)
            ),
            whence=numbers.attributes("curves", index),
        )
        for index, curve in of_group
    )
    says = (
        f"{_TITLES[kind]} of {listed([line.label for line in lines])} over frequency; numbers are in the table below."
    )
    return LineChart(f"{_TITLES[kind]}: {what}", says, x, y, lines)
