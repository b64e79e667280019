"""What charts are made of, with all places worked out; the templates only write it as SVG."""

from collections.abc import Sequence
from dataclasses import dataclass

from markupsafe import Markup

from pnpct.report.axes import Axis

LEFT, RIGHT, TOP, BOTTOM = 54.0, 390.0, 12.0, 226.0
ACROSS, UP, ALONG = (LEFT, RIGHT), (BOTTOM, TOP), (12.0, RIGHT)
"""Where the axes of a line chart begin and end, and that of a bar chart."""

ROW = 36.0
"""Height of a bar with its name."""


@dataclass(frozen=True)
class Point:
    """A point of a line: where, the ends of its interval, and what it says when pointed at."""

    x: float
    y: float
    low: float | None = None
    high: float | None = None
    says: str = ""


@dataclass(frozen=True)
class Line:
    """A line of a chart.

    Args:
        label: Whose it is.
        style: Class of its colour.
        points: Its points.
        whence: Attributes that name its values in `metrics.json`.
        dots: Whether its points are marked.
    """

    label: str
    style: str
    points: tuple[Point, ...]
    whence: Markup
    dots: bool = False

    @property
    def polyline(self) -> str:
        """The points as SVG has them."""
        return " ".join(f"{point.x:g},{point.y:g}" for point in self.points)


@dataclass(frozen=True)
class LineChart:
    """Lines over two axes, with their title and a sentence for who cannot see them."""

    title: str
    says: str
    x: Axis
    y: Axis
    lines: tuple[Line, ...]


@dataclass(frozen=True)
class Mark:
    """A line across all bars: the value that they should reach, and what it is."""

    place: float
    label: str
    whence: str = ""


@dataclass(frozen=True)
class Bar:
    """A bar with its name above it.

    Args:
        label: Whose it is.
        style: Class of its colour.
        start: Place of 0.
        end: Place of the value.
        top: Place of the upper edge of its row.
        number: The value for readers, with its path.
        interval: Places of the ends of its interval.
        past: Where the part begins that is beyond the mark; None if there is none.
        tag: A word of warning.
    """

    label: str
    style: str
    start: float
    end: float
    top: float
    number: Markup
    interval: tuple[float, float] | None = None
    past: float | None = None
    tag: str = ""

    @property
    def left(self) -> float:
        """Its left end."""
        return min(self.start, self.end)

    @property
    def length(self) -> float:
        """Its length."""
        return abs(self.end - self.start)

    @property
    def hatched(self) -> tuple[float, float] | None:
        """Left end and length of the part beyond the mark."""
        return None if self.past is None else (min(self.past, self.end), abs(self.past - self.end))


@dataclass(frozen=True)
class BarChart:
    """Bars below each other, with their title and a sentence for who cannot see them."""

    title: str
    says: str
    axis: Axis
    bars: tuple[Bar, ...]
    marks: tuple[Mark, ...] = ()

    @property
    def bottom(self) -> float:
        """Place of the axis, below the last bar."""
        return TOP + ROW * len(self.bars)

    @property
    def height(self) -> float:
        """Height of the drawing."""
        return self.bottom + 42.0


def row_top(number: int) -> float:
    """Return the place of the upper edge of a row of bars."""
    return TOP + ROW * number


def legend_of(charts: Sequence[LineChart]) -> tuple[tuple[str, str], ...]:
    """Return whose lines some charts have, each with the class of its colour."""
    return tuple(dict.fromkeys((line.label, line.style) for chart in charts for line in chart.lines))


def listed(words: Sequence[str]) -> str:
    """Join words as a sentence does.

    Example:
        >>> listed(["a", "b", "c"])
        'a, b and c'
    """
    return " and ".join(filter(None, [", ".join(words[:-1]), *words[-1:]]))
