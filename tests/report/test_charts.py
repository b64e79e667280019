"""Bars, lines and points of the charts are where the numbers of the comparison say."""

import math
import re
from xml.etree import ElementTree

import pytest
from small_comparison import NAMES, make_comparison

from pnpct.report.bars import grey_values, lesion_bars, texture_changes
from pnpct.report.curves import curve_charts
from pnpct.report.results import Results
from pnpct.report.tasks import groups, task_charts

SVG = "{http://www.w3.org/2000/svg}"
COLOURS = {name: f"var(--c{number})" for number, name in enumerate(NAMES)}


@pytest.fixture(scope="module")
def results(tmp_path_factory) -> Results:
    return Results(make_comparison(tmp_path_factory.mktemp("charts")))


def paths(chart, colour):
    """The points of each line or shape of a colour."""
    found = [
        path.get("d")
        for path in ElementTree.fromstring(chart.svg).iter(f"{SVG}path")
        if colour in (path.get("stroke"), path.get("fill")) and path.get("clip-path")
    ]
    return [[(float(x), float(y)) for x, y in re.findall(r"[ML] ([\d.-]+) ([\d.-]+)", d)] for d in found]


def assert_bars(chart, values, aim=None, intervals=()):
    """All bars begin at the line of 0, and they, the aim and the whiskers end where one scale has them."""
    zero = paths(chart, "var(--quiet)")[0][0][0]
    ends = {}
    for name in values:
        (bar,) = paths(chart, COLOURS[name])
        xs = [x for x, _ in bar]
        assert min(abs(x - zero) for x in xs) < 0.01
        ends[name] = max(xs, key=lambda x: abs(x - zero)) - zero
    assert not [name for name in NAMES if name not in values and paths(chart, COLOURS[name])]
    scale = sum(abs(end) for end in ends.values()) / sum(abs(value) for value in values.values())
    assert ends == pytest.approx({name: scale * value for name, value in values.items()}, abs=0.02)
    if aim is not None:
        assert paths(chart, "var(--c-given)")[0][0][0] - zero == pytest.approx(scale * aim, abs=0.02)
    drawn = [tuple((x - zero) / scale for x, _ in path) for path in paths(chart, "var(--ink)") if len(path) == 2]
    assert sorted(drawn) == [pytest.approx(each, abs=0.02 / scale) for each in sorted(intervals)]


def test_bars_of_texture_end_at_the_ratio_of_the_means_and_the_line_is_the_reference(results):
    for group, of_page in zip(results.comparison.texture_change.values(), texture_changes(results), strict=True):
        assert len(of_page.bars.charts) == 7
        for number, chart in enumerate(of_page.bars.charts):
            changes = {name: found.features[number] for name, found in group.changes.items()}
            first = next(iter(changes.values()))
            assert_bars(
                chart,
                {name: change.ratio_of_means for name, change in changes.items()},
                100.0 * (first.reference / first.fbp - 1.0),
                [(change.interval.low, change.interval.high) for change in changes.values() if change.interval],
            )


def test_bars_of_grey_values_end_at_the_distance_and_the_line_is_that_of_the_repeat(results):
    for found, chart in zip(results.comparison.histogram.values(), grey_values(results).charts, strict=True):
        values = {name: found[name]["emd"] for name in NAMES}
        assert_bars(chart, values, found["reference"]["repeat_scan_floor"])


def test_bars_of_lesions_end_at_what_is_left_in_percent_and_the_line_is_all_of_it(results):
    for found, chart in zip(results.comparison.lesions.values(), lesion_bars(results).charts, strict=True):
        assert_bars(chart, {name: 100.0 * entry.recovered for name, entry in found.items()}, 100.0)


def assert_lines(chart, lines):
    """All lines go through their values, where one pair of axes has them."""
    drawn = {
        name: next(path for path in paths(chart, COLOURS[name]) if len(path) == len(lines[name])) for name in lines
    }
    for axis in (0, 1):
        pairs = sorted(
            (value[axis], at[axis]) for name in lines for value, at in zip(lines[name], drawn[name], strict=True)
        )
        (low, start), (high, end) = pairs[0], pairs[-1]
        slope = (end - start) / (high - low)
        assert slope * (-1) ** axis > 0  # to the right, and up
        assert [at for _, at in pairs] == pytest.approx([start + slope * (v - low) for v, _ in pairs], abs=0.02)
    return drawn


def test_curves_go_through_their_values(results):
    curves = results.comparison.curves
    for kind, chart in zip(("noise-power", "transfer"), curve_charts(results), strict=True):
        of_kind = {curve.method: curve for curve in curves if curve.kind == kind}
        assert_lines(chart, {name: [*zip(c.frequency_per_mm, c.values, strict=True)] for name, c in of_kind.items()})


def test_detectability_goes_through_its_estimates_with_intervals_on_logarithmic_axes(results):
    for group, chart in zip(groups(results), task_charts(results), strict=True):
        points = {task.method: [(p.tube_current_ma, p.found.d_prime) for p in task.points] for _, task in group.tasks}
        lines = {name: [(math.log(ma), math.log(d.estimate)) for ma, d in of] for name, of in points.items()}
        drawn = assert_lines(chart, lines)
        (low, top), (high, bottom) = ((lines["fbp"][n][1], drawn["fbp"][n][1]) for n in (0, -1))
        slope = (bottom - top) / (high - low)
        for name, of in points.items():
            whiskers = [path for path in paths(chart, COLOURS[name]) if len(path) == 2]
            expected = [[slope * (math.log(end) - low) + top for end in (d.low, d.high)] for _, d in of]
            assert [[y for _, y in each] for each in whiskers] == [pytest.approx(e, abs=0.02) for e in expected]
