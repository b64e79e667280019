"""Texture and grey values against FBP and the reference, as bars."""

from collections.abc import Mapping

from markupsafe import Markup

from pnpct.comparison import Case, Comparison
from pnpct.evaluation import FeatureChange, TextureChange, oversmoothing_warnings
from pnpct.evaluation.oversmoothing import overshoots
from pnpct.report.axes import Axis, fitted
from pnpct.report.charts import ALONG, Bar, BarChart, Mark, listed, row_top
from pnpct.report.images import labels
from pnpct.report.marked_numbers import Numbers
from pnpct.report.tables import Head, Row, Table
from pnpct.report.words import spell, title_of

FLOOR = "repeat_scan_floor"


def change_charts(comparison: Comparison, numbers: Numbers) -> tuple[BarChart, ...]:
    """Return a chart for each feature: the change from FBP by each method, with the reference as a mark."""
    changes = comparison.texture_change
    return tuple(
        _change_chart({method: of_method[index] for method, of_method in changes.items()}, index, comparison, numbers)
        for index in range(min(map(len, changes.values()), default=0))
    )


def oversmoothed(comparison: Comparison) -> dict[str, str]:
    """Return which methods are smoother than the reference, and farther from it than FBP: label and features."""
    found = {}
    for method, changes in comparison.texture_change.items():
        if oversmoothing_warnings(TextureChange(changes, spec_hash="")):
            beyond = [change.feature for change in changes if overshoots(change)]
            found[labels(comparison).get(method, method)] = listed(beyond or ["contrast", "homogeneity"])
    return found


def near_style(closeness: float | None) -> str:
    """Return the class of the colour of a closeness, in quarters from farther (near--4) to there (near-4)."""
    return "near-none" if closeness is None else f"near-{round(4 * max(-1.0, min(1.0, closeness)))}"


def histogram_charts(comparison: Comparison, numbers: Numbers, styles: Mapping[str, str]) -> tuple[BarChart, ...]:
    """Return a chart for each case: the earth mover's distance of each method, with the repeat-scan floor."""
    charts = (_histogram_chart(comparison, case, numbers, styles) for case in comparison.cases)
    return tuple(chart for chart in charts if chart is not None)


def change_table(comparison: Comparison, numbers: Numbers, styles: Mapping[str, str]) -> Table:
    """Return all numbers behind the charts of changes."""
    heads = (
        "feature",
        "FBP",
        "method",
        "reference",
        "ratio of means",
        "95 % from",
        "to",
        "mean of ratios",
        "closeness",
    )
    units = ("", "", "", "", "%", "%", "%", "%", "")
    words = (True, *(False for _ in units[1:]))
    rows = []
    names = labels(comparison)
    for method, changes in comparison.texture_change.items():
        for index, change in enumerate(changes):
            at = "texture_change", method, index
            cells = (
                title_of(change.feature) + (" †" if change.images_disagree else ""),
                *(numbers(*at, name) for name in ("fbp", "method", "reference")),
                numbers(*at, "ratio_of_means", signed=True),
                numbers(*at, "interval", "low", signed=True),
                numbers(*at, "interval", "high", signed=True),
                numbers(*at, "mean_of_ratios", signed=True),
                numbers(*at, "closeness", digits=2),
            )
            rows.append(Row(names.get(method, method), cells, styles.get(method, "")))
    return Table("Change of texture from FBP", tuple(map(Head, heads, units, words)), tuple(rows))


def _change_chart(
    changes: Mapping[str, FeatureChange], index: int, comparison: Comparison, numbers: Numbers
) -> BarChart:
    """One feature by all methods."""
    names, axis = labels(comparison), _change_axis(changes)
    paths = {method: ("texture_change", method, index) for method in changes}
    bars = tuple(
        _change_bar(change, names.get(method, method), axis, row, numbers, paths[method])
        for row, (method, change) in enumerate(changes.items())
    )
    says = "; ".join(f"{names.get(m, m)} {spell(change.ratio_of_means)} %" for m, change in changes.items())
    method, first = next(iter(changes.items()))
    of_reference = _relative(first)
    whence = numbers.attributes(*paths[method], "reference")
    marks = () if of_reference is None else (Mark(axis.at(of_reference), "reference", whence),)
    return BarChart(title_of(first.feature), f"Change from FBP: {says}.", axis, bars, marks)


def _histogram_chart(
    comparison: Comparison, case: Case, numbers: Numbers, styles: Mapping[str, str]
) -> BarChart | None:
    of_case = comparison.histogram.get(case.name, {})
    names = labels(comparison)
    found = {m: value for m in names if (value := of_case.get(m, {}).get("emd")) is not None}
    if not found:
        return None
    floor = of_case.get("reference", {}).get(FLOOR)
    values = [*found.values(), *([] if floor is None else [floor])]
    axis = fitted(values, ALONG, title="EMD, window from 0 to 1")
    bars = tuple(
        Bar(
            label=names[method],
            style=styles[method],
            start=axis.at(0.0),
            end=axis.at(value),
            top=row_top(row),
            number=_tspan(numbers, "histogram", case.name, method, "emd"),
        )
        for row, (method, value) in enumerate(found.items())
    )
    says = "; ".join(f"{names[method]} {spell(value)}" for method, value in found.items())
    whence = numbers.attributes("histogram", case.name, "reference", FLOOR)
    marks = () if floor is None else (Mark(axis.at(floor), "repeat-scan floor", whence),)
    return BarChart(case.label, f"Earth mover's distance: {says}.", axis, bars, marks)


def _relative(change: FeatureChange) -> float | None:
    """The reference as a change from FBP, percent."""
    return None if change.reference is None else 100.0 * (change.reference / change.fbp - 1.0)


def _change_axis(changes: Mapping[str, FeatureChange]) -> Axis:
    values: list[float] = []
    for change in changes.values():
        ends = () if change.interval is None else (change.interval.low, change.interval.high)
        values += [change.ratio_of_means, *ends]
        if (of_reference := _relative(change)) is not None:
            values.append(of_reference)
    return fitted(values, ALONG, title="change from FBP, %")


def _change_bar(
    change: FeatureChange, label: str, axis: Axis, row: int, numbers: Numbers, at: tuple[str | int, ...]
) -> Bar:
    of_reference = _relative(change)
    beyond = of_reference is not None and (
        change.ratio_of_means > of_reference > 0 or change.ratio_of_means < of_reference < 0
    )
    return Bar(
        label=label,
        style=near_style(change.closeness),
        start=axis.at(0.0),
        end=axis.at(change.ratio_of_means),
        top=row_top(row),
        number=_tspan(numbers, *at, "ratio_of_means", signed=True) + Markup(" %"),
        interval=None if change.interval is None else (axis.at(change.interval.low), axis.at(change.interval.high)),
        past=axis.at(of_reference) if beyond and of_reference is not None else None,
        tag="over-smoothed" if overshoots(change) else "",
    )


def _tspan(numbers: Numbers, *keys: str | int, signed: bool = False) -> Markup:
    """A number inside the text of a drawing."""
    words = numbers.text(*keys, signed=signed)
    return Markup("<tspan {}>{}</tspan>").format(numbers.attributes(*keys), words)
