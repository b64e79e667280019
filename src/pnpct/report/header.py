"""What stands first on a page: the verdicts of all checks, the data, the methods and the fingerprints."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from markupsafe import Markup

from pnpct.comparison import Check, Comparison
from pnpct.report.images import GIVEN, FoundImage, labels
from pnpct.report.marked_numbers import NOT_MEASURED, Numbers
from pnpct.report.tables import Cell, Head, Row, Table

_URGENCY = {"fail": 0, "not judged": 1, "pass": 2}
_MARKS = {"fail": "✕", "not judged": "–", "pass": "✓"}


@dataclass(frozen=True)
class Light:
    """A check with its verdict.

    Args:
        place: A name for it on the page.
        check: The check.
        case: Of which case, in words; empty if of none.
        method: Of which method, in words; empty if of none.
        value: Its number for readers.
        allowed: What passes, for readers.
    """

    place: str
    check: Check
    case: str
    method: str
    value: Markup
    allowed: Markup

    @property
    def about(self) -> str:
        """Case and method in words."""
        return ", ".join(filter(None, (self.case, self.method))) or "all"

    @property
    def mark(self) -> str:
        """A sign for the verdict that does without colour."""
        return _MARKS[self.check.verdict]

    @property
    def style(self) -> str:
        """Class of its colour."""
        return self.check.verdict.replace(" ", "-")


def lights(comparison: Comparison, of_images: Sequence[Check], numbers: Numbers) -> tuple[Light, ...]:
    """Return all checks, what failed first.

    Args:
        comparison: The comparison.
        of_images: Checks that the report has made itself; they have no numbers.
        numbers: The numbers of the comparison.
    """
    names = labels(comparison)
    case_labels = {case.name: case.label for case in comparison.cases}
    found = []
    for index, check in enumerate([*comparison.checks, *of_images]):
        case, method = case_labels.get(check.case or "", check.case), names.get(check.method or "", check.method)
        own = index >= len(comparison.checks)
        value = NOT_MEASURED if own or check.value is None else numbers("checks", index, "value", digits=4)
        found.append(Light(f"check-{index}", check, case or "", method or "", value, _allowed(check, index, numbers)))
    return tuple(sorted(found, key=lambda light: _URGENCY[light.check.verdict]))


def by_name(all_lights: Sequence[Light]) -> dict[str, list[Light]]:
    """Sort lights by what is checked, those with the worst verdict first."""
    groups: dict[str, list[Light]] = {}
    for light in all_lights:
        groups.setdefault(light.check.name, []).append(light)
    return groups


def failures(all_lights: Sequence[Light]) -> dict[str, list[list[Light]]]:
    """Sort lights that failed by what is checked, and then by method, whose cases stand together."""
    groups: dict[str, dict[str, list[Light]]] = {}
    for light in all_lights:
        if light.check.verdict == "fail":
            groups.setdefault(light.check.name, {}).setdefault(light.method, []).append(light)
    return {name: list(by_method.values()) for name, by_method in groups.items()}


def counted(all_lights: Sequence[Light]) -> dict[str, int]:
    """Count the verdicts."""
    return {verdict: sum(light.check.verdict == verdict for light in all_lights) for verdict in _URGENCY}


def case_table(comparison: Comparison, numbers: Numbers) -> Table:
    """Return what was scanned, and how."""
    heads = (
        *(Head("tube current", "mA"), Head("tube voltage", "kVp"), Head("geometry", words=True)),
        *(Head("rows"), Head("columns"), Head("pixel", "mm"), Head("disc of the scores", "mm")),
        Head("seed of the noise"),
    )
    rows = tuple(
        Row(
            case.label,
            (
                *(numbers.exact("cases", n, name) for name in ("tube_current_ma", "tube_voltage_kvp")),
                case.geometry,
                *(numbers.exact("cases", n, "grid", name) for name in ("rows", "cols")),
                *(numbers("cases", n, *keys, digits=4) for keys in (("grid", "spacing"), ("disc_mm",))),
                "measured" if case.seed is None else numbers.exact("cases", n, "seed"),
            ),
        )
        for n, case in enumerate(comparison.cases)
    )
    return Table("Data", heads, rows)


def method_table(comparison: Comparison, numbers: Numbers, styles: Mapping[str, str]) -> Table:
    """Return the methods with their settings."""
    rows = []
    for n, method in enumerate(comparison.methods):
        settings = Markup(", ").join(
            Markup("{} {}").format(" ".join(keys), numbers.exact("methods", n, "settings", *keys))
            for keys in _leaves(method.settings)
        )
        rows.append(Row(method.label, (method.role, settings or NOT_MEASURED), styles[method.name]))
    return Table("Methods", (Head("role", words=True), Head("settings", words=True)), tuple(rows))


def definition_rows(comparison: Comparison, numbers: Numbers) -> tuple[tuple[str, Markup], ...]:
    """Return the definitions, each with its value; nested names are joined."""
    return tuple((": ".join(keys), numbers.exact("definitions", *keys)) for keys in _leaves(comparison.definitions))


def fingerprint_table(comparison: Comparison, images: Sequence[FoundImage]) -> Table:
    """Return the fingerprint of each image as it is now."""
    names = {**labels(comparison), **GIVEN}
    case_labels = {case.name: case.label for case in comparison.cases}
    titles = ("case", "shows", "SHA-256 of pixels and grid", "as measured")
    heads = tuple(Head(title, words=True) for title in titles)
    rows = tuple(
        Row(names[image.method], (case_labels[image.case], image.shows or "image", _code(image), _verdict(image)))
        for image in images
    )
    return Table("Images", heads, rows)


def _code(image: FoundImage) -> Cell:
    return Markup("<code>{}</code>").format(image.sha256)


def _verdict(image: FoundImage) -> Cell:
    return Markup('<strong class="changed">no, changed</strong>') if image.changed else "yes"


def _allowed(check: Check, index: int, numbers: Numbers) -> Markup:
    low, high = (
        _limit(value, numbers, "checks", index, name) for name, value in (("low", check.low), ("high", check.high))
    )
    if check.low is not None and check.high is not None:
        return Markup("{} to {}").format(low, high)
    if check.low is not None:
        return Markup("at least {}").format(low)
    return NOT_MEASURED if check.high is None else Markup("at most {}").format(high)


def _limit(value: float | None, numbers: Numbers, *at: str | int) -> Markup:
    """A limit that somebody has chosen with its own digits, one that was computed with as many as its value has."""
    chosen = value is not None and float(f"{value:.4g}") == value
    return numbers.exact(*at) if chosen else numbers(*at, digits=4)


def _leaves(values: Mapping[str, Any], *above: str) -> Iterator[tuple[str, ...]]:
    """Where the plain values of nested names are."""
    for name, value in values.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, *above, str(name))
        else:
            yield (*above, str(name))
