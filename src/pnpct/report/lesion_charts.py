"""What became of lesions that were put into the data."""

from collections.abc import Mapping

from markupsafe import Markup

from pnpct.comparison import Comparison, lesion_in_words
from pnpct.report.axes import fitted
from pnpct.report.charts import ALONG, Bar, BarChart, Mark, row_top
from pnpct.report.images import labels
from pnpct.report.marked_numbers import Numbers
from pnpct.report.tables import Head, Row, Table
from pnpct.report.words import spell


def lesion_charts(comparison: Comparison, numbers: Numbers, styles: Mapping[str, str]) -> tuple[BarChart, ...]:
    """Return a chart for each case with a lesion: the share of its contrast that each image shows."""
    names = labels(comparison)
    charts = []
    for case, found in comparison.lesions.items():
        percents = {method: 100.0 * entry.recovered for method, entry in found.items()}
        axis = fitted([100.0, *percents.values()], ALONG, title="contrast that is left, %")
        bars = tuple(
            Bar(
                label=names.get(method, method),
                style=styles.get(method, ""),
                start=axis.at(0.0),
                end=axis.at(percent),
                top=row_top(row),
                number=_share(numbers, case, method),
            )
            for row, (method, percent) in enumerate(percents.items())
        )
        says = "; ".join(f"{names.get(method, method)} {spell(percent)} %" for method, percent in percents.items())
        lesion = next(iter(found.values())).lesion  # the same for all methods
        title = f"{_case_label(comparison, case)}: {lesion_in_words(2 * lesion.radius, lesion.contrast_hu)}"
        marks = (Mark(axis.at(100.0), "all of it"),)
        charts.append(BarChart(title, f"Contrast that is left: {says}.", axis, bars, marks))
    return tuple(charts)


def lesion_table(comparison: Comparison, numbers: Numbers, styles: Mapping[str, str]) -> Table:
    """Return all numbers of the lesions."""
    heads = (
        *(
            Head("case", words=True),
            Head("radius", "mm"),
            Head("contrast put in", "HU"),
            Head("contrast left", "%"),
        ),
        *(Head("spill", "%"), Head("change far away", "HU RMS")),
    )
    rows = tuple(
        _row(comparison, numbers, styles, case, method)
        for case, found in comparison.lesions.items()
        for method in found
    )
    return Table("Lesions put into the data", heads, rows)


def _row(comparison: Comparison, numbers: Numbers, styles: Mapping[str, str], case: str, method: str) -> Row:
    at = "lesions", case, method
    cells = (
        _case_label(comparison, case),
        numbers.exact(*at, "lesion", "radius"),
        numbers(*at, "lesion", "contrast_hu", signed=True),
        numbers(*at, "recovered", scale=100.0),
        numbers(*at, "spill", scale=100.0),
        numbers(*at, "distant_hu"),
    )
    return Row(labels(comparison).get(method, method), cells, styles.get(method, ""))


def _share(numbers: Numbers, case: str, method: str) -> Markup:
    path = "lesions", case, method, "recovered"
    words = numbers.text(*path, scale=100.0)
    return Markup("<tspan {}>{}</tspan> %").format(numbers.attributes(*path, scale=100.0), words)


def _case_label(comparison: Comparison, name: str) -> str:
    return next((case.label for case in comparison.cases if case.name == name), name)
