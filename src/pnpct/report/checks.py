"""All checks, each once: a table for each method, with what was checked below each other and a column for each case."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from markupsafe import Markup

from pnpct.comparison import Check
from pnpct.comparison.schema import Verdict
from pnpct.report.marked_numbers import NOT_MEASURED, Numbers
from pnpct.report.results import Results

VERDICTS: tuple[Verdict, ...] = ("fail", "not judged", "pass")


@dataclass(frozen=True)
class Judged:
    """A check for readers.

    Args:
        check: The check.
        value: Its number.
        allowed: What passes.
    """

    check: Check
    value: Markup
    allowed: Markup


@dataclass(frozen=True)
class MethodChecks:
    """The checks of one method.

    Args:
        method: Its name; None for checks of no method.
        label: What readers see.
        heads: Labels of the cases, and "phantoms" for what is about no case.
        rows: What is checked, and the checks in each column.
    """

    method: str | None
    label: str
    heads: tuple[str, ...]
    rows: tuple[tuple[str, tuple[tuple[Judged, ...], ...]], ...]

    @property
    def all(self) -> tuple[Judged, ...]:
        """All its checks."""
        return tuple(one for _, columns in self.rows for column in columns for one in column)

    @property
    def counts(self) -> dict[Verdict, int]:
        """Count the verdicts."""
        return counted(one.check for one in self.all)


def counted(checks: Iterable[Check]) -> dict[Verdict, int]:
    """Count verdicts, failures first."""
    verdicts = [check.verdict for check in checks]
    return {verdict: verdicts.count(verdict) for verdict in VERDICTS}


def method_checks(results: Results, of_images: Sequence[Check] = ()) -> tuple[MethodChecks, ...]:
    """Return all checks, methods in the order of the page.

    Args:
        results: The comparison.
        of_images: Checks that the report has made itself; they have no numbers.
    """
    found = [
        *(_judged(results.numbers, index, check) for index, check in enumerate(results.comparison.checks)),
        *(Judged(check, NOT_MEASURED, NOT_MEASURED) for check in of_images),
    ]
    given = [name for name in results.labels if name not in results.methods]
    methods = dict.fromkeys([*results.methods, *given, *(one.check.method for one in found)])
    tables = (_of_method(results, method, [one for one in found if one.check.method == method]) for method in methods)
    return tuple(table for table in tables if table.rows)


def _of_method(results: Results, method: str | None, found: Sequence[Judged]) -> MethodChecks:
    asked = dict.fromkeys(one.check.case for one in found)
    cases = [case for case in [*dict.fromkeys([*results.cases, *filter(None, asked)]), None] if case in asked]
    names = dict.fromkeys(one.check.name for one in found)
    rows = tuple(
        (name, tuple(tuple(o for o in found if (o.check.name, o.check.case) == (name, case)) for case in cases))
        for name in names
    )
    label = "All methods" if method is None else results.label(method)
    return MethodChecks(
        method, label, tuple(results.cases.get(case, case) if case else "phantoms" for case in cases), rows
    )


def _judged(numbers: Numbers, index: int, check: Check) -> Judged:
    value = NOT_MEASURED if check.value is None else numbers("checks", index, "value", digits=4)
    return Judged(check, value, _allowed(check, index, numbers))


def _allowed(check: Check, index: int, numbers: Numbers) -> Markup:
    low, high = (
        _limit(value, numbers, "checks", index, name) for name, value in (("low", check.low), ("high", check.high))
    )
    if check.low is not None and check.high is not None:
        return Markup("{} to {}").format(low, high)
    if check.low is not None:
        return Markup("at least {}").format(low)
    return Markup() if check.high is None else Markup("at most {}").format(high)


def _limit(value: float | None, numbers: Numbers, *at: str | int) -> Markup:
    """A limit that somebody has chosen with its own digits, one that was computed with as many as its value has."""
    chosen = value is not None and float(f"{value:.4g}") == value
    return numbers.exact(*at) if chosen else numbers(*at, digits=4)
