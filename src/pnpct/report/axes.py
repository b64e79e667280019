"""Axes of charts: from a value to a place, and ticks at round numbers."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from pnpct.report.words import spell_exactly


@dataclass(frozen=True)
class Tick:
    """A mark on an axis: where, and what is written there."""

    place: float
    text: str


@dataclass(frozen=True)
class Axis:
    """A linear or logarithmic axis.

    Args:
        low: Lowest value; positive on a logarithmic axis.
        high: Highest value, above `low`.
        start: Place of the lowest value, in units of the drawing.
        end: Place of the highest value; below `start` for an axis that points up.
        title: What it shows, with its unit.
        log: Whether it is logarithmic.
    """

    low: float
    high: float
    start: float
    end: float
    title: str = ""
    log: bool = False

    def at(self, value: float) -> float:
        """Return the place of a value; what is beyond the axis is at its end."""
        inside = min(max(value, self.low), self.high)
        low, high, inside = (math.log(v) if self.log else v for v in (self.low, self.high, inside))
        return round(self.start + (self.end - self.start) * (inside - low) / (high - low), 2)

    @property
    def ticks(self) -> tuple[Tick, ...]:
        """Marks at round numbers."""
        values = _round_logarithms(self.low, self.high) if self.log else _round_numbers(self.low, self.high)
        return tuple(Tick(self.at(value), spell_exactly(round(value, 12))) for value in values)


def fitted(
    values: Iterable[float], span: tuple[float, float], *, title: str = "", log: bool = False, zero: bool = True
) -> Axis:
    """Return an axis that holds all values, with a little room.

    Args:
        values: What must be on it; values that are not positive are left out on a logarithmic axis.
        span: Places of its lowest and of its highest value.
        title: What it shows.
        log: Whether it is logarithmic.
        zero: Whether a linear axis must hold 0.
    """
    kept = [value for value in values if value > 0] if log else [*values, *([0.0] if zero else [])]
    start, end = span
    low, high = (min(kept), max(kept)) if kept else (1.0, 10.0)
    if log:
        room = max((high / low) ** 0.06, 1.1 if high > 2 * low else 2.0)
        return Axis(low / room, high * room, start, end, title, log=True)
    room = 0.06 * (high - low) or 1.0
    below, above = low < 0 or not zero, high > 0 or not zero or low == high
    return Axis(low - room * below, high + room * above, start, end, title)


def _round_numbers(low: float, high: float) -> list[float]:
    rough = (high - low) / 4
    power = 10.0 ** math.floor(math.log10(rough))
    step = min((factor * power for factor in (1, 2, 5, 10)), key=lambda candidate: abs(math.log(candidate / rough)))
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [number * step for number in range(first, last + 1)]


def _round_logarithms(low: float, high: float) -> list[float]:
    """All digits of a short axis, 1, 2, 5 of a longer one, or the decades alone where there are many."""
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    leading = range(1, 10) if high / low < 8 else (1, 2, 5) if high / low < 1000 else (1,)
    values = [factor * 10.0**decade for decade in decades for factor in leading]
    return [value for value in values if low <= value <= high]
