"""Charts are SVG that the page styles: words are words, colours have names, nothing is a style or an identifier."""

import re
from xml.etree import ElementTree

import pytest

from pnpct.report.drawing import ROW, TOP, Bar, Line, bar_chart, line_chart
from pnpct.report.results import TOKENS

SVG = "{http://www.w3.org/2000/svg}"
BARS = [Bar(40.0, "40 HU", TOKENS["c1"], (35.0, 50.0)), None, Bar(-20.0, "−20 HU", TOKENS["c2"], hollow=True)]


@pytest.fixture(scope="module")
def bars():
    return ElementTree.fromstring(bar_chart("Bias", BARS, axis="bias, HU", says="Bias <b>", width=240, aim=10.0).svg)


def shapes(root, colour):
    """Left and right ends of the closed shapes that have a colour."""
    paths = [p for p in root.iter(f"{SVG}path") if colour in (p.get("fill"), p.get("stroke")) and "z" in p.get("d")]
    xs = [[float(x) for x in re.findall(r"[ML] ([\d.-]+) ", path.get("d"))] for path in paths]
    return [(min(x), max(x)) for x in xs]


def test_bars_are_as_long_as_their_values(bars):
    ((zero, right),) = shapes(bars, "var(--c1)")
    ((left, end),) = shapes(bars, "var(--c2)")
    assert end == pytest.approx(zero, abs=0.01)
    assert (right - zero) / (zero - left) == pytest.approx(2.0, rel=1e-3)
    (aim,) = [p for p in bars.iter(f"{SVG}path") if p.get("stroke") == "var(--c-given)"]
    assert float(aim.get("d").split()[1]) == pytest.approx(zero + (right - zero) / 4, abs=0.01)


def test_rows_have_their_height_whether_there_is_a_bar_or_not(bars):
    tops = {text.text: float(text.get("y")) for text in bars.iter(f"{SVG}text")}
    assert tops["−20 HU"] - tops["40 HU"] == pytest.approx(2 * ROW, abs=0.01)


def test_hollow_bars_have_an_outline_alone(bars):
    (path,) = [p for p in bars.iter(f"{SVG}path") if p.get("stroke") == "var(--c2)"]
    assert path.get("fill") == "none"


def test_words_can_be_read_and_the_picture_has_a_name(bars):
    assert {"Bias", "bias, HU", "40 HU", "−20 HU"} <= {text.text for text in bars.iter(f"{SVG}text")}
    assert (bars.get("role"), bars.get("aria-label"), bars.get("width")) == ("img", "Bias <b>", "240")


def test_a_chart_has_no_styles_and_no_names_that_another_has_too(bars):
    for element in bars.iter():
        assert "style" not in element.attrib
        assert element.tag != f"{SVG}style"
    names = [element.get("id") for element in bars.iter() if "id" in element.attrib]
    again = bar_chart("Bias", BARS, axis="bias, HU", says="another", width=240).svg
    assert names
    assert not [name for name in names if f'id="{name}"' in again]


def test_lines_go_through_their_values_and_the_dashed_one_is_dashed():
    lines = [
        Line("a", TOKENS["c3"], [0.0, 1.0, 2.0], [0.0, 4.0, 2.0]),
        Line("$b$ & <c>", TOKENS["c4"], [0.0, 2.0], [2.0, 2.0], dashed=True),
    ]
    root = ElementTree.fromstring(line_chart("t", lines, axes=("$x$", "y <"), says="Lines").svg)
    first, second = ([p for p in root.iter(f"{SVG}path") if p.get("stroke") == f"var(--c{n})"] for n in (3, 4))
    points = [tuple(map(float, p)) for p in re.findall(r"[ML] ([\d.]+) ([\d.]+)", first[0].get("d"))]
    (x0, y0), (x1, y1), (x2, y2) = points
    assert x1 - x0 == pytest.approx(x2 - x1, abs=0.01)
    assert (y0 - y1) == pytest.approx(2 * (y0 - y2), abs=0.01)  # up is more
    assert "stroke-dasharray" in second[0].attrib
    assert "stroke-dasharray" not in first[0].attrib
    assert {"$x$", "y <"} <= {text.text for text in root.iter(f"{SVG}text")}


def test_on_logarithmic_axes_a_power_law_is_straight_and_intervals_are_drawn():
    x = [20.0, 80.0, 320.0]
    ends = [(0.5 * value**0.5, 2 * value**0.5) for value in x]
    chart = line_chart(
        "t", [Line("a", TOKENS["c5"], x, [v**0.5 for v in x], ends)], axes=("x", "y"), says="d", log=True
    )
    root = ElementTree.fromstring(chart.svg)
    paths = [
        re.findall(r"[ML] ([\d.]+) ([\d.]+)", p.get("d"))
        for p in root.iter(f"{SVG}path")
        if p.get("stroke") == "var(--c5)"
    ]
    (line,) = [p for p in paths if len(p) == 3]
    (x0, y0), (x1, y1), (x2, y2) = (tuple(map(float, p)) for p in line)
    assert (x1 - x0, y1 - y0) == pytest.approx((x2 - x1, y2 - y1), abs=0.02)
    whiskers = [p for p in paths if len(p) == 2]
    assert len(whiskers) == 3
    for (_, low), (_, high) in whiskers:
        assert float(low) - float(high) == pytest.approx(2 * (y0 - y1), abs=0.02)  # a factor of 4, as √(320/20)


def test_the_same_chart_is_the_same_text():
    assert bar_chart("t", BARS, axis="a", says="s", width=240) == bar_chart("t", BARS, axis="a", says="s", width=240)


def test_a_long_title_has_two_lines_above_the_first_bar():
    title = "abdomen-000-row00, 100 mA, 120 kVp: 12 mm, −40 HU and more words than there is room for"
    root = ElementTree.fromstring(bar_chart(title, BARS, axis="a", says="s", width=240).svg)
    heights = {text.text: float(text.get("y")) for text in root.iter(f"{SVG}text")}
    first, second = "abdomen-000-row00, 100 mA, 120", "kVp: 12 mm, −40 HU and more …"
    assert 8 < heights[first] < heights[second] < TOP
