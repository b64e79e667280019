"""What is shown as bars: texture, grey values, and lesions that were put into the data."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from markupsafe import Markup

from pnpct.comparison import Case, TextureGroup, lesion_in_words
from pnpct.evaluation import FeatureChange, oversmoothing_warnings
from pnpct.evaluation.texture.oversmoothing import overshoots
from pnpct.report.drawing import Bar, Chart, bar_chart
from pnpct.report.results import Results
from pnpct.report.tables import Head, Row, Table
from pnpct.report.words import listed, spell, title_of

FLOOR = "repeat_scan_floor"


@dataclass(frozen=True)
class Bars:
    """Charts beside each other with the same methods in the same rows.

    Args:
        methods: Name and class of the colour of each row.
        charts: The charts.
    """

    methods: tuple[tuple[str, str], ...]
    charts: tuple[Chart, ...]


@dataclass(frozen=True)
class TextureChanges:
    """The change of texture at one tube current.

    Args:
        title: Which tube current.
        patients: How many patients there are.
        patches: How many patches there are.
        ranking: Methods, best first; empty where closeness is known of none.
        oversmoothed: Which methods are smoother than the reference, and farther from it than FBP: with the features.
        bars: A chart for each feature.
        table: All numbers behind them.
    """

    title: str
    patients: Markup
    patches: Markup
    ranking: tuple[str, ...]
    oversmoothed: Mapping[str, str]
    bars: Bars
    table: Table


def texture_changes(results: Results) -> tuple[TextureChanges, ...]:
    """Return the change of texture from FBP at each tube current, against the reference."""
    found = results.comparison.texture_change
    return tuple(_texture(results, name, group) for name, group in found.items() if group.changes)


def grey_values(results: Results) -> Bars:
    """Return for each case the earth mover's distance of each method from the reference, and that of its repeat."""

    def chart(case: Case) -> Chart | None:
        of_case = results.comparison.histogram.get(case.name, {})
        found = {name: value for name in results.methods if (value := of_case.get(name, {}).get("emd")) is not None}
        floor = of_case.get("reference", {}).get(FLOOR)
        return _chart(results, case.label, found, axis="EMD, window from 0 to 1", width=width, aim=floor)

    width = _width(len(results.comparison.cases))
    return _beside(results, map(chart, results.comparison.cases))


def lesion_bars(results: Results) -> Bars:
    """Return for each case the share of a lesion's contrast that is left in each image."""
    width = _width(len(results.comparison.lesions))

    def chart(case: str) -> Chart | None:
        found = results.comparison.lesions[case]
        lesion = next(iter(found.values())).lesion  # the same for all methods
        title = f"{results.cases.get(case, case)}: {lesion_in_words(2 * lesion.radius, lesion.contrast_hu)}"
        percents = {method: 100.0 * entry.recovered for method, entry in found.items()}
        return _chart(results, title, percents, axis="contrast that is left, %", unit=" %", width=width, aim=100.0)

    return _beside(results, map(chart, results.comparison.lesions))


def lesion_tables(results: Results) -> tuple[Table, ...]:
    """Return all numbers of the lesions, a table for each case."""
    heads = (
        *(Head("radius", "mm"), Head("contrast put in", "HU"), Head("contrast left", "%")),
        *(Head("spill", "%"), Head("change far away", "HU RMS")),
    )
    numbers = results.numbers

    def row(case: str, method: str) -> Row:
        at = "lesions", case, method
        cells = (
            numbers.exact(*at, "lesion", "radius"),
            numbers(*at, "lesion", "contrast_hu", signed=True),
            *(numbers(*at, name, scale=100.0) for name in ("recovered", "spill")),
            numbers(*at, "distant_hu"),
        )
        return Row(results.label(method), cells, results.style(method))

    return tuple(
        Table(f"Lesion put into the data: {results.cases.get(case, case)}", heads, tuple(row(case, m) for m in found))
        for case, found in results.comparison.lesions.items()
    )


def _beside(results: Results, charts: Iterator[Chart | None]) -> Bars:
    return Bars(results.method_styles, tuple(chart for chart in charts if chart is not None))


def _width(charts: int) -> int:
    """Width of each of several charts that stand beside each other, dots: one fits on a phone beside the names."""
    return max(160, min(236, 1130 // max(1, charts)))


def _chart(
    results: Results,
    title: str,
    values: Mapping[str, float],
    *,
    axis: str,
    width: int,
    aim: float | None,
    unit: str = "",
    spelled: Callable[[float], str] = spell,
    intervals: Mapping[str, tuple[float, float]] | None = None,
) -> Chart | None:
    """A row for each method of the comparison."""
    if not values:
        return None
    bars = [
        Bar(
            values[name],
            spelled(values[name]) + unit,
            results.colour(name),
            (intervals or {}).get(name),
            hollow=name in results.controls,
        )
        if name in values
        else None
        for name in results.methods
    ]
    numbers = "; ".join(f"{results.label(name)} {spelled(value)}{unit}" for name, value in values.items())
    return bar_chart(title, bars, axis=axis, says=f"{title}, {axis}: {numbers}.", width=width, aim=aim)


def _texture(results: Results, name: str, group: TextureGroup) -> TextureChanges:
    known = any(change.closeness is not None for changes in group.changes.values() for change in changes.features)
    features = range(min(len(changes.features) for changes in group.changes.values()))
    title = f"Measured scans{name.removeprefix('measured')}" if name.startswith("measured") else f"At {name}"
    charts = (
        _feature(results, {method: of.features[feature] for method, of in group.changes.items()}, len(features))
        for feature in features
    )
    return TextureChanges(
        title,
        results.numbers.exact("texture_change", name, "patients"),
        results.numbers.exact("texture_change", name, "patches"),
        tuple(map(results.label, group.ranking)) if known else (),
        _oversmoothed(results, group),
        _beside(results, charts),
        _texture_table(results, name, group),
    )


def _feature(results: Results, changes: Mapping[str, FeatureChange], features: int) -> Chart | None:
    """One feature by all methods; a black line is the reference."""
    first = next(iter(changes.values()))
    return _chart(
        results,
        title_of(first.feature),
        {method: change.ratio_of_means for method, change in changes.items()},
        axis="change, %",
        unit=" %",
        spelled=lambda value: spell(value, signed=True, digits=2),
        width=_width(features),
        aim=None if first.reference is None else 100.0 * (first.reference / first.fbp - 1.0),
        intervals={method: (i.low, i.high) for method, change in changes.items() if (i := change.interval)},
    )


def _oversmoothed(results: Results, group: TextureGroup) -> dict[str, str]:
    found = {}
    for method, changes in group.changes.items():
        if oversmoothing_warnings(changes):
            beyond = [change.feature for change in changes.features if overshoots(change)]
            found[results.label(method)] = listed(beyond or ["contrast", "homogeneity"])
    return found


def _texture_table(results: Results, name: str, group: TextureGroup) -> Table:
    heads = (
        *(Head("feature", words=True), Head("FBP"), Head("method"), Head("reference"), Head("ratio of means", "%")),
        *(Head("95 % from", "%"), Head("to", "%"), Head("mean of ratios", "%"), Head("closeness")),
    )
    rows = tuple(
        Row(results.label(method), _cells(results, change, ("texture_change", name, "changes", method, "features", n)))
        for method, changes in group.changes.items()
        for n, change in enumerate(changes.features)
    )
    return Table(f"Change of texture from FBP, {name}", heads, rows)


def _cells(results: Results, change: FeatureChange, at: Sequence[str | int]) -> tuple[str, ...]:
    numbers = results.numbers
    signed = (("ratio_of_means",), ("interval", "low"), ("interval", "high"), ("mean_of_ratios",))
    return (
        title_of(change.feature) + (" †" if change.images_disagree else ""),
        *(numbers(*at, value) for value in ("fbp", "method", "reference")),
        *(numbers(*at, *value, signed=True) for value in signed),
        numbers(*at, "closeness", digits=2),
    )
