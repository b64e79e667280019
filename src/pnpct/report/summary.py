"""The small table that a page begins with: a row for each method, five numbers, and a mark for each."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from markupsafe import Markup

from pnpct.comparison import Check
from pnpct.comparison.lesion_checks import RECOVERED
from pnpct.comparison.schema import Verdict
from pnpct.report.results import Results
from pnpct.report.words import title_of, unit_of

Path = tuple[str | int, ...]

AS_SHARP = 0.9
"""Share of the baseline's f50 from which on a method counts as sharp as it."""

DATA_CHECKS = (
    *("residual chi-square", "residual correlation along views", "residual correlation along bins"),
    *("largest score", "cross-view score"),
)
"""Checks of an image against the rays that were measured."""


@dataclass(frozen=True)
class Mark:
    """A verdict, and over how many checks it was taken."""

    verdict: Verdict
    failed: int = 0
    of: int = 1


@dataclass(frozen=True)
class Cell:
    """A number, from the least to the largest over the cases, and its mark; None where nothing tells good from bad."""

    number: Markup
    mark: Mark | None


@dataclass(frozen=True)
class Measure:
    """A column: its title and unit, and what number and mark mean."""

    title: str
    unit: str
    means: str
    cells: tuple[Cell, ...]


@dataclass(frozen=True)
class Summary:
    """The table.

    Args:
        methods: Name, label and class of the colour of each row.
        measures: Its columns; what was measured of no method is left out.
    """

    methods: tuple[tuple[str, str, str], ...]
    measures: tuple[Measure, ...]


def summary(results: Results) -> Summary:
    """Return the table: error, noise, sharpness, contrast of a lesion, agreement with the data."""
    methods = tuple((name, results.labels[name], results.style(name)) for name in results.methods)
    columns = (
        _column(
            results,
            ("error", unit_of(results.error or "")),
            f"{title_of(results.error or '')} against the truth. ✓ less than FBP with its best kernel.",
            lambda name: [("fidelity", case, name, results.error or "") for case in results.comparison.fidelity],
            lambda name: _worst(results, name, ("error against FBP",)),
        ),
        _column(
            results,
            ("noise", "HU"),
            "standard deviation in a water phantom. ✓ less than the baseline.",
            lambda name: _curves(results, name, "noise_hu"),
            lambda name: _against_baseline(results, name, "noise_hu", lambda own, other: own < other),
        ),
        _column(
            results,
            ("sharpness", "1/mm"),
            f"frequency at which a disc keeps half of its contrast. ✓ at least {100 * AS_SHARP:g} % of the baseline's.",
            lambda name: _curves(results, name, "f50_per_mm"),
            lambda name: _against_baseline(results, name, "f50_per_mm", lambda own, other: own >= AS_SHARP * other),
        ),
        _column(
            results,
            ("lesion contrast", "%"),
            "what is left of a lesion that was put into the data. ✓ {:.0%} to {:.0%}.".format(*RECOVERED).replace(
                "%", " %"
            ),
            lambda name: [("lesions", case, name, "recovered") for case in results.comparison.lesions],
            lambda name: _worst(results, name, ("lesion recovery",)),
            scale=100.0,
        ),
        _column(
            results,
            ("misfit to the data", ""),
            "chi-square of the residual, over that of the truth where known. ✓ no check against the data failed.",
            lambda name: [
                ("checks", index, "value")
                for index, check in enumerate(results.comparison.checks)
                if (check.name, check.method) == ("residual chi-square", name)
            ],
            lambda name: _worst(results, name, DATA_CHECKS),
        ),
    )
    return Summary(methods, tuple(column for column in columns if any(cell.number for cell in column.cells)))


def _column(
    results: Results,
    title: tuple[str, str],
    means: str,
    paths: Callable[[str], Sequence[Path]],
    mark: Callable[[str], Mark | None],
    *,
    scale: float = 1.0,
) -> Measure:
    cells = tuple(Cell(_range(results, paths(name), scale), mark(name)) for name in results.methods)
    return Measure(*title, means, cells)


def _range(results: Results, paths: Sequence[Path], scale: float) -> Markup:
    """From the least to the largest number, one if they are spelled alike; nothing if there is none."""
    known = sorted((value, path) for path in paths if (value := results.numbers.find(*path)) is not None)
    ends = [results.numbers(*path, scale=scale) for _, path in (known[:1] + known[-1:])]
    if len({results.numbers.text(*path, scale=scale) for _, path in known}) < 2:
        ends = ends[:1]
    return Markup(" to ").join(ends)


def _curves(results: Results, method: str, name: str) -> list[Path]:
    return [
        ("curves", index, "summary", name)
        for index, curve in enumerate(results.comparison.curves)
        if curve.method == method and name in curve.summary
    ]


def _against_baseline(results: Results, method: str, name: str, better: Callable[[float, float], bool]) -> Mark | None:
    """Compare a number of curves with that of the baseline, object by object."""
    if results.baseline in (None, method):
        return None
    curves = results.comparison.curves
    values = {(curve.method, curve.what): curve.summary.get(name) for curve in curves if name in curve.summary}
    pairs = [(value, values.get((results.baseline, what))) for (of, what), value in values.items() if of == method]
    judged = [better(own, other) for own, other in pairs if own is not None and other is not None]
    return Mark("pass" if all(judged) else "fail", judged.count(False), len(judged)) if judged else None


def _worst(results: Results, method: str, names: Sequence[str]) -> Mark | None:
    """The worst verdict of some checks of a method over all cases."""
    found = [check for check in results.comparison.checks if check.method == method and check.name in names]
    return _mark(found) if found else None


def _mark(checks: Sequence[Check]) -> Mark:
    verdicts = [check.verdict for check in checks]
    failed = verdicts.count("fail")
    worst: Verdict = "fail" if failed else "pass" if "pass" in verdicts else "not judged"
    return Mark(worst, failed, len(verdicts))
