"""What became of lesions that were put into the data."""

from collections.abc import Mapping

from markupsafe import Markup

from pnpct.comparison import Comparison, LesionResult
from pnpct.report.axes import fitted
from pnpct.report.charts import ALONG, Bar, BarChart, Mark, row_top
from pnpct.report.images import labels
from pnpct.report.marked_numbers import Numbers
from pnpct.report.tables import Head, Row, Table
from pnpct.report.words import spell


def lesion_charts(comparison: Comparison, numbers: Numbers, styles: Mapping[str, str]) -> tuple[BarChart, ...]:
    """Return a chart for each lesion of each case: the share of its contrast that each image shows."""
    names = labels(comparison)
    charts = []
    for case, lesion in dict.fromkeys((entry.case, entry.lesion) for entry in comparison.lesions):
        entries = [(n, e) for n, e in enumerate(comparison.lesions) if (e.case, e.lesion) == (case, lesion)]
        percents = [100.0 * entry.recovered for _, entry in entries]
        axis = fitted([100.0, *percents], ALONG, title="contrast that is left, %")
        bars = tuple(
            Bar(
                label=names.get(entry.method, entry.method),
                style=styles.get(entry.method, ""),
                start=axis.at(0.0),
                end=axis.at(percent),
                top=row_top(row),
                number=_share(numbers, index),
            )
            for row, ((index, entry), percent) in enumerate(zip(entries, percents, strict=True))
        )
        says = "; ".join(f"{bar.label} {spell(percent)} %" for bar, percent in zip(bars, percents, strict=True))
        title = f"{_case_label(comparison, case)}: {lesion}"
        marks = (Mark(axis.at(100.0), "all of it"),)
        charts.append(BarChart(title, f"Contrast that is left: {says}.", axis, bars, marks))
    return tuple(charts)


def lesion_table(comparison: Comparison, numbers: Numbers, styles: Mapping[str, str]) -> Table:
    """Return all numbers of the lesions."""
    heads = (
        *(
            Head("case", words=True),
            Head("lesion", words=True),
            Head("contrast put in", "HU"),
            Head("contrast left", "%"),
        ),
        *(Head("spill", "%"), Head("change far away", "HU RMS")),
    )
    rows = tuple(_row(comparison, numbers, styles, *entry) for entry in enumerate(comparison.lesions))
    return Table("Lesions put into the data", heads, rows)


def _row(comparison: Comparison, numbers: Numbers, styles: Mapping[str, str], index: int, entry: LesionResult) -> Row:
    cells = (
        _case_label(comparison, entry.case),
        entry.lesion,
        numbers("lesions", index, "contrast_hu", signed=True),
        numbers("lesions", index, "recovered", scale=100.0),
        numbers("lesions", index, "spill", scale=100.0),
        numbers("lesions", index, "distant_hu"),
    )
    return Row(labels(comparison).get(entry.method, entry.method), cells, styles.get(entry.method, ""))


def _share(numbers: Numbers, index: int) -> Markup:
    path = "lesions", index, "recovered"
    words = numbers.text(*path, scale=100.0)
    return Markup("<tspan {}>{}</tspan> %").format(numbers.attributes(*path, scale=100.0), words)


def _case_label(comparison: Comparison, name: str) -> str:
    return next((case.label for case in comparison.cases if case.name == name), name)
