"""Charts by matplotlib as SVG in a page: words stay words, and colours follow the page into the dark."""

import io
import textwrap
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree

import matplotlib as mpl
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pnpct.report.results import TOKENS

ROW, TOP, BOTTOM = 28, 44, 40
"""Height of a bar with its surroundings, and what is above the first bar and below the last, in dots of the screen."""

VALUES = 62
"""Width of the numbers to the right of bars, in dots."""

_SVG, _LINK = "{http://www.w3.org/2000/svg}", "{http://www.w3.org/1999/xlink}href"
_LOOK: dict[Any, Any] = {
    **dict.fromkeys(("axes.labelcolor", "xtick.labelcolor", "ytick.labelcolor"), TOKENS["quiet"]),
    **dict.fromkeys((f"axes.spines.{side}" for side in ("left", "right", "top", "bottom")), False),
    **dict.fromkeys(("font.size", "axes.labelsize"), 12.0),
    **dict.fromkeys(("xtick.major.size", "ytick.major.size"), 0),
    **dict.fromkeys(("axes.grid", "axes.axisbelow"), True),
    "grid.color": TOKENS["line"],
    "grid.linewidth": 1.0,
    "text.parse_math": False,
}
_NAMES = {colour: f"var(--{name})" for name, colour in TOKENS.items()}


@dataclass(frozen=True)
class Chart:
    """A chart with its title, as a page shows it."""

    title: str
    svg: Markup


@dataclass(frozen=True)
class Line:
    """A line of a chart: values over places, with the ends of their intervals where these are known."""

    label: str
    colour: str
    x: Sequence[float]
    y: Sequence[float]
    intervals: Sequence[tuple[float, float]] = ()
    dashed: bool = False


@dataclass(frozen=True)
class Bar:
    """A bar of a chart: its value, how that is spelled, and the ends of its interval where they are known."""

    value: float
    text: str
    colour: str
    interval: tuple[float, float] | None = None
    hollow: bool = False


def line_chart(title: str, lines: Sequence[Line], *, axes: tuple[str, str], says: str, log: bool = False) -> Chart:
    """Draw lines over two axes.

    Args:
        title: What stands above.
        lines: The lines.
        axes: Titles of the axes, with units.
        says: A sentence for who cannot see it.
        log: Whether both axes are logarithmic; dots mark the points then.
    """
    with _drawn(318, 260, left=52, right=10, top=8, bottom=46) as (figure, plot):
        plot.set(xlabel=axes[0], ylabel=axes[1])
        if log:
            plot.set(xscale="log", yscale="log")
            for axis in (plot.xaxis, plot.yaxis):
                axis.set_major_locator(mpl.ticker.LogLocator(subs=(1.0, 2.0, 5.0)))
                axis.set_major_formatter("{x:g}")
                axis.set_minor_locator(mpl.ticker.NullLocator())
        for line in lines:
            style = "--" if line.dashed else "-"
            plot.plot(line.x, line.y, style, color=line.colour, marker="o" if log else "", markersize=5, linewidth=2)
            for x, ends in zip(line.x, line.intervals, strict=False):
                plot.plot((x, x), ends, color=line.colour, linewidth=1)
        if not log:
            plot.set_ylim(bottom=min(0.0, plot.get_ylim()[0]))
            plot.set_xlim(left=0.0)
    return Chart(title, as_svg(figure, says))


def bar_chart(
    title: str, bars: Sequence[Bar | None], *, axis: str, says: str, width: int, aim: float | None = None
) -> Chart:
    """Draw bars below each other, whose names stand beside the chart in lines of the height `ROW`.

    Args:
        title: What stands above, in two lines at most.
        bars: The bars; None leaves a row empty.
        axis: Title of the axis, with its unit.
        says: A sentence for who cannot see it.
        width: Of the drawing, dots.
        aim: What the bars should reach: a thick line.
    """
    height = TOP + ROW * len(bars) + BOTTOM
    with _drawn(width, height, left=16, right=VALUES, top=TOP, bottom=BOTTOM) as (figure, plot):
        plot.set(xlabel=axis, ylim=(len(bars) - 0.5, -0.5), yticks=[])
        words: dict[str, Any] = {"transform": plot.transAxes, "weight": "bold", "color": TOKENS["ink"]}
        lines = textwrap.wrap(title, (width - 16) // 7, max_lines=2, placeholder=" …")
        for number, line in enumerate(reversed(lines)):
            plot.text(0.0, 1 + (12 + 15 * number) / (ROW * len(bars)), line, **words)
        plot.axvline(0.0, color=TOKENS["quiet"], linewidth=1)
        for row, bar in enumerate(bars):
            if bar is None:
                continue
            face = "none" if bar.hollow else bar.colour
            plot.barh(row, bar.value, height=0.5, facecolor=face, edgecolor=bar.colour, linewidth=1.5)
            if bar.interval is not None:
                plot.plot(bar.interval, (row, row), "|-", color=TOKENS["ink"], linewidth=1.2, markersize=7)
            place = plot.get_yaxis_transform()
            plot.text(
                1 + (VALUES - 6) / (width - 16 - VALUES),
                row,
                bar.text,
                transform=place,
                ha="right",
                va="center",
                color=TOKENS["ink"],
            )
        if aim is not None:
            plot.axvline(aim, color=TOKENS["c-given"], linewidth=2.5)
        plot.xaxis.set_major_locator(mpl.ticker.MaxNLocator(3, steps=(1, 2, 5, 10)))
        plot.margins(x=0.06)
    return Chart(title, as_svg(figure, says))


@contextmanager
def _drawn(width: int, height: int, *, left: int, right: int, top: int, bottom: int) -> Iterator[tuple[Figure, Axes]]:
    """A sheet of so many dots, and axes with such margins on it, in the look of the page."""
    with mpl.rc_context(_LOOK):
        figure = Figure(figsize=(width / 72, height / 72))
        inside = (width - left - right) / width, (height - top - bottom) / height
        yield figure, figure.add_axes((left / width, bottom / height, *inside))


def as_svg(figure: Figure, says: str) -> Markup:
    """Write a figure as an element of a page, in the colours of its style sheet.

    The page allows no styles but its own, so declarations become attributes.

    Args:
        figure: The figure.
        says: What a reader hears who cannot see it; it also makes the names inside unique.
    """
    content = io.StringIO()
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": says}):
        figure.savefig(content, format="svg", metadata={"Date": None}, transparent=True)
    ElementTree.register_namespace("", _SVG.strip("{}"))
    root = ElementTree.fromstring(content.getvalue())
    root.remove(root[0])  # metadata
    shared = {id(element) for defs in root.iter(f"{_SVG}defs") for element in defs.iter()}
    for element in root.iter():
        for declaration in element.attrib.pop("style", "").split(";"):
            name, _, value = (part.strip() for part in declaration.partition(":"))
            if value and name != "font-family":
                element.set(name, _NAMES.get(value, value))
        if _LINK in element.attrib:
            element.set("href", element.attrib.pop(_LINK))
        if id(element) not in shared:
            element.attrib.pop("id", None)
    for defs in [*root.iter(f"{_SVG}defs")]:
        for style in defs.findall(f"{_SVG}style"):
            defs.remove(style)
    size = {name: root.attrib[name].removesuffix("pt") for name in ("width", "height")}
    root.attrib.update({**size, "class": "plot", "role": "img", "aria-label": says})
    return Markup(ElementTree.tostring(root, encoding="unicode"))
