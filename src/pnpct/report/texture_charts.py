"""Texture and grey values against FBP and the reference, as bars."""

from collections.abc import Mapping
from dataclasses import dataclass

from markupsafe import Markup

from pnpct.comparison import Case, Comparison, TextureGroup
from pnpct.evaluation import FeatureChange, oversmoothing_warnings
from pnpct.evaluation.texture.oversmoothing import overshoots
from pnpct.report.axes import Axis, fitted
from pnpct.report.charts import ALONG, Bar, BarChart, Mark, listed, row_top
from pnpct.report.images import labels
from pnpct.report.marked_numbers import Numbers
from pnpct.report.tables import Head, Row, Table
from pnpct.report.words import spell, title_of

FLOOR = "repeat_scan_floor"


@dataclass(frozen=True)
class ChangeGroup:
    """The change of texture at one tube current.

    Args:
        title: Which tube current.
        patients: How many patients there are.
        patches: How many patches there are.
        ranking: Labels of the methods, best first; empty where closeness is known of none.
        oversmoothed: Which methods are smoother than the reference, and farther from it than FBP: label and features.
        charts: One for each feature, the reference being a mark.
        table: All numbers behind them.
    """

    title: str
    patients: Markup
    patches: Markup
    ranking: tuple[str, ...]
    oversmoothed: Mapping[str, str]
    charts: tuple[BarChart, ...]
    table: Table


def change_groups(comparison: Comparison, numbers: Numbers, styles: Mapping[str, str]) -> tuple[ChangeGroup, ...]:
    """Return the change of texture from FBP at each tube current."""
    return tuple(
        _change_group(name, group, comparison, numbers, styles)
        for name, group in comparison.texture_change.items()
        if group.changes
    )


def near_style(closeness: float | None) -> str:
    """Return the class of the colour of a closeness, in quarters from farther (near--4) to there (near-4)."""
    return "near-none" if closeness is None else f"near-{round(4 * max(-1.0, min(1.0, closeness)))}"


def histogram_charts(comparison: Comparison, numbers: Numbers, styles: Mapping[str, str]) -> tuple[BarChart, ...]:
    """Return a chart for each case: each method's earth mover's distance from the reference, and that of its repeat."""
    charts = (_histogram_chart(comparison, case, numbers, styles) for case in comparison.cases)
    return tuple(chart for chart in charts if chart is not None)


def _change_group(
    name: str, group: TextureGroup, comparison: Comparison, numbers: Numbers, styles: Mapping[str, str]
) -> ChangeGroup:
    names, at = labels(comparison), ("texture_change", name)
    known = any(change.closeness is not None for changes in group.changes.values() for change in changes.features)
    features = range(min(len(changes.features) for changes in group.changes.values()))
    title = f"Measured scans{name.removeprefix('measured')}" if name.startswith("measured") else f"At {name}"
    return ChangeGroup(
        title,
        numbers.exact(*at, "patients"),
        numbers.exact(*at, "patches"),
        tuple(names.get(method, method) for method in group.ranking) if known else (),
        {names.get(method, method): said for method, said in _oversmoothed(group).items()},
        tuple(_change_chart(name, group, feature, comparison, numbers) for feature in features),
        _change_table(name, group, comparison, numbers, styles),
    )


def _oversmoothed(group: TextureGroup) -> dict[str, str]:
    found = {}
    for method, changes in group.changes.items():
        if oversmoothing_warnings(changes):
            beyond = [change.feature for change in changes.features if overshoots(change)]
            found[method] = listed(beyond or ["contrast", "homogeneity"])
    return found


def _change_table(
    name: str, group: TextureGroup, comparison: Comparison, numbers: Numbers, styles: Mapping[str, str]
) -> Table:
    heads = (
        *(Head("feature", words=True), Head("FBP"), Head("method"), Head("reference"), Head("ratio of means", "%")),
        *(Head("95 % from", "%"), Head("to", "%"), Head("mean of ratios", "%"), Head("closeness")),
    )
    rows = []
    names = labels(comparison)
    for method, changes in group.changes.items():
        for index, change in enumerate(changes.features):
            at = "texture_change", name, "changes", method, "features", index
            cells = (
                title_of(change.feature) + (" †" if change.images_disagree else ""),
                *(numbers(*at, value) for value in ("fbp", "method", "reference")),
                numbers(*at, "ratio_of_means", signed=True),
                numbers(*at, "interval", "low", signed=True),
                numbers(*at, "interval", "high", signed=True),
                numbers(*at, "mean_of_ratios", signed=True),
                numbers(*at, "closeness", digits=2),
            )
            rows.append(Row(names.get(method, method), cells, styles.get(method, "")))
    return Table(f"Change of texture from FBP, {name}", heads, tuple(rows))


def _change_chart(name: str, group: TextureGroup, feature: int, comparison: Comparison, numbers: Numbers) -> BarChart:
    """One feature by all methods."""
    changes = {method: of_method.features[feature] for method, of_method in group.changes.items()}
    names, axis = labels(comparison), _change_axis(changes)
    paths = {method: ("texture_change", name, "changes", method, "features", feature) for method in changes}
    bars = tuple(
        _change_bar(change, names.get(method, method), axis, row, numbers, paths[method])
        for row, (method, change) in enumerate(changes.items())
    )
    says = "; ".join(f"{names.get(m, m)} {spell(change.ratio_of_means)} %" for m, change in changes.items())
    method, first = next(iter(changes.items()))
    of_reference = _relative(first)
    whence = numbers.attributes(*paths[method], "reference")
    marks = () if of_reference is None else (Mark(axis.at(of_reference), "reference", whence),)
    return BarChart(title_of(first.feature), f"{name}, change from FBP: {says}.", axis, bars, marks)


def _histogram_chart(
    comparison: Comparison, case: Case, numbers: Numbers, styles: Mapping[str, str]
) -> BarChart | None:
    of_case = comparison.histogram.get(case.name, {})
    names = {method.name: method.label for method in comparison.methods}
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
