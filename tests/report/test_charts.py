"""Every bar, tick, line and point of a chart is where its number says."""

import re

import pytest
from parsed_page import DrawnAxis, metrics, parse, resolve

from pnpct.report.charts import listed
from pnpct.report.texture_charts import near_style


@pytest.fixture(scope="module")
def page(report):
    return parse(report)


@pytest.fixture(scope="module")
def content(folder):
    return metrics(folder)


def bar_charts(page):
    return [chart for chart in page.all("svg", style="plot") if "data-y" not in chart.attributes]


def line_charts(page):
    return [chart for chart in page.all("svg", style="plot") if "data-y" in chart.attributes]


def bars(chart):
    """The bars of a chart, each with the element that shows its number."""
    groups = [group for group in chart.all("g") if group.all("rect", style="bar")]
    return [(group, group.all("rect", style="bar")[0].attributes, group.all("tspan")) for group in groups]


def test_bars_end_where_their_numbers_are(page, content):
    seen = 0
    for chart in bar_charts(page):
        axis = DrawnAxis.of(chart, "data-x")
        for _, bar, spans in bars(chart):
            (number,) = [span.attributes for span in spans if "data-path" in span.attributes]
            value = resolve(content, number["data-path"]) * float(number.get("data-scale", "1"))
            left = axis.value(float(bar["x"]))
            right = axis.value(float(bar["x"]) + float(bar["width"]))
            assert (left, right) == pytest.approx((min(value, 0.0), max(value, 0.0)), abs=2 * axis.error(value))
            seen += 1
    assert seen == 2 * 2 * 7 + 2 * 3 + 3  # features at two tube currents, cases, lesions


def test_the_tick_is_the_reference_and_the_floor(page, content):
    marks = [(chart, mark.attributes) for chart in bar_charts(page) for mark in chart.all("line", style="mark")]
    paths = {mark.get("data-path", "").rpartition("/")[2] for _, mark in marks}
    assert paths == {"reference", "repeat_scan_floor", ""}
    for chart, mark in marks:
        axis = DrawnAxis.of(chart, "data-x")
        place, path = axis.value(float(mark["x1"])), mark.get("data-path", "")
        value = 100.0 if not path else resolve(content, path)
        if path.endswith("/reference"):
            fbp = resolve(content, path.removesuffix("reference") + "fbp")
            value = 100.0 * (value / fbp - 1.0)
        assert place == pytest.approx(value, abs=axis.error(value))


def test_intervals_reach_from_end_to_end(page, content):
    seen = 0
    for chart in bar_charts(page):
        axis = DrawnAxis.of(chart, "data-x")
        for group, _, spans in bars(chart):
            for whisker in group.all("path", style="whisker"):
                (number,) = [span.attributes for span in spans if "data-path" in span.attributes]
                interval = resolve(content, number["data-path"].removesuffix("ratio_of_means") + "interval")
                low, high = map(float, re.match(r"M([\d.]+),[\d.]+H([\d.]+)", whisker.attributes["d"]).groups())
                ends = axis.value(low), axis.value(high)
                assert ends == pytest.approx((interval["low"], interval["high"]), abs=axis.error(1.0))
                seen += 1
    assert seen == 2 * 6  # one feature has none, and neither has what is of two patients


def test_colours_are_those_of_closeness(page, content):
    for chart in bar_charts(page):
        for group, _, spans in bars(chart):
            (number,) = [span.attributes["data-path"] for span in spans if "data-path" in span.attributes]
            if number.startswith("/texture_change"):
                closeness = resolve(content, number.removesuffix("ratio_of_means") + "closeness")
                assert group.classes == {near_style(closeness)}


@pytest.mark.parametrize(
    ("closeness", "style"),
    [(1.0, "near-4"), (0.0, "near-0"), (-1.0, "near--4"), (-7.0, "near--4"), (0.5, "near-2"), (None, "near-none")],
)
def test_closeness_runs_from_farther_to_there(closeness, style):
    assert near_style(closeness) == style


def test_over_smoothing_is_told_and_hatched(page):
    assert "Over-smoothed: Blurred FBP (entropy)." in " ".join(page.text.split())
    groups = [group for chart in bar_charts(page) for group, _, _ in bars(chart)]
    (tagged,) = [group for group in groups if group.all("tspan", style="tag")]  # closeness is known at 40 mA alone
    assert "Blurred FBP over-smoothed" in tagged.text
    hatched = [group for group in groups if group.all("rect", style="hatch")]
    assert len(hatched) == 2 * 7
    assert all("Blurred FBP" in group.text for group in hatched)


def test_curves_go_through_their_values(page, content):
    seen = 0
    for chart in line_charts(page):
        x, y = DrawnAxis.of(chart, "data-x"), DrawnAxis.of(chart, "data-y")
        for group in [g for g in chart.all("g") if "data-path" in g.attributes]:
            known = resolve(content, group.attributes["data-path"])
            if "points" in known:
                expected = [
                    (point["tube_current_ma"], point["found"]["d_prime"]["estimate"]) for point in known["points"]
                ]
            else:
                expected = list(zip(known["frequency_per_mm"], known["values"], strict=True))
            drawn = [tuple(map(float, p.split(","))) for p in group.all("polyline")[0].attributes["points"].split()]
            for (across, up), (of_x, of_y) in zip(drawn, expected, strict=True):
                assert x.value(across) == pytest.approx(of_x, abs=x.error(of_x))
                assert y.value(up) == pytest.approx(of_y, abs=y.error(of_y))
            seen += 1
    assert seen == 6 + 9


def test_intervals_of_detectability_are_drawn(page, content):
    for chart in line_charts(page):
        y = DrawnAxis.of(chart, "data-y")
        for group in [g for g in chart.all("g") if g.attributes.get("data-path", "").startswith("/tasks")]:
            points = resolve(content, group.attributes["data-path"])["points"]
            for whisker, point in zip(group.all("line", style="whisker"), points, strict=True):
                ends = [y.value(float(whisker.attributes[end])) for end in ("y1", "y2")]
                d_prime = point["found"]["d_prime"]
                assert ends == pytest.approx([d_prime["low"], d_prime["high"]], rel=1e-3)


def test_words_are_joined_as_a_sentence_does():
    assert (listed([]), listed(["a"]), listed(["a", "b"]), listed(["a", "b", "c"])) == (
        "",
        "a",
        "a and b",
        "a, b and c",
    )
