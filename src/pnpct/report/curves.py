"""Noise power and transfer over frequency."""

from pnpct.comparison import Curve
from pnpct.report.drawing import Chart, Line, line_chart
from pnpct.report.results import Results
from pnpct.report.tables import Head, Row, Table
from pnpct.report.words import listed, title_of, unit_of

TITLES = {"noise-power": "Noise power", "transfer": "Transfer"}
_AXES = {"noise-power": "noise power, HU² mm²", "transfer": "transfer"}


def curve_charts(results: Results) -> tuple[Chart, ...]:
    """Return a chart for each kind of curve and each object that it was measured on."""
    return tuple(_chart(results, kind, what) for kind, what in _groups(results))


def curve_tables(results: Results) -> tuple[Table, ...]:
    """Return the numbers that were taken from the curves, a table for each chart."""
    found = (_table(results, kind, what) for kind, what in _groups(results))
    return tuple(table for table in found if table.heads)


def _groups(results: Results) -> list[tuple[str, str]]:
    return sorted(dict.fromkeys((curve.kind, curve.what) for curve in results.comparison.curves))


def _curves(results: Results, kind: str, what: str) -> list[tuple[int, Curve]]:
    return [(n, curve) for n, curve in enumerate(results.comparison.curves) if (curve.kind, curve.what) == (kind, what)]


def _chart(results: Results, kind: str, what: str) -> Chart:
    lines = [
        Line(
            results.label(curve.method),
            results.colour(curve.method),
            curve.frequency_per_mm,
            curve.values,
            dashed=curve.method in results.controls,
        )
        for _, curve in _curves(results, kind, what)
    ]
    title = f"{TITLES[kind]}: {what}"
    says = f"{title}, over frequency, of {listed([line.label for line in lines])}; numbers are in the table below."
    return line_chart(title, lines, axes=("frequency, 1/mm", _AXES[kind]), says=says)


def _table(results: Results, kind: str, what: str) -> Table:
    curves = _curves(results, kind, what)
    names = [*dict.fromkeys(name for _, curve in curves for name in curve.summary)]
    heads = tuple(Head(title_of(name), unit_of(name)) for name in names)
    rows = tuple(
        Row(
            results.label(curve.method),
            tuple(results.numbers("curves", index, "summary", name) for name in names),
            results.style(curve.method),
        )
        for index, curve in curves
    )
    return Table(f"{TITLES[kind]}: {what}", heads, rows)
