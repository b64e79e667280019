"""What was compared: scans, methods with their settings, definitions, and fingerprints of the images."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from markupsafe import Markup

from pnpct.report.images import FoundImage
from pnpct.report.marked_numbers import NOT_MEASURED
from pnpct.report.results import Results
from pnpct.report.tables import Head, Row, Table


def case_table(results: Results) -> Table:
    """Return what was scanned, and how."""
    numbers = results.numbers
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
        for n, case in enumerate(results.comparison.cases)
    )
    return Table("Data", heads, rows)


def method_table(results: Results) -> Table:
    """Return the methods with their settings."""
    rows = []
    for n, method in enumerate(results.comparison.methods):
        settings = Markup(", ").join(
            Markup("{} {}").format(" ".join(keys), results.numbers.exact("methods", n, "settings", *keys))
            for keys in _leaves(method.settings)
        )
        rows.append(Row(method.label, (method.role, settings or NOT_MEASURED), results.style(method.name)))
    return Table("Methods", (Head("role", words=True), Head("settings", words=True)), tuple(rows))


def definition_rows(results: Results) -> tuple[tuple[str, Markup], ...]:
    """Return the definitions, each with its value; nested names are joined."""
    return tuple(
        (": ".join(keys), results.numbers.exact("definitions", *keys))
        for keys in _leaves(results.comparison.definitions)
    )


def fingerprint_tables(results: Results, images: Sequence[FoundImage]) -> tuple[Table, ...]:
    """Return the fingerprint of each image as it is now, a table for each case."""
    heads = tuple(Head(title, words=True) for title in ("shows", "SHA-256 of pixels and grid", "as measured"))
    return tuple(
        Table(
            f"Images: {case.label}",
            heads,
            tuple(_fingerprint(results, image) for image in images if image.case == case.name),
        )
        for case in results.comparison.cases
    )


def _fingerprint(results: Results, image: FoundImage) -> Row:
    code = Markup("<code>{}</code>").format(image.sha256)
    verdict = Markup('<strong class="changed">no, changed</strong>') if image.changed else "yes"
    return Row(results.labels[image.method], (image.shows or "image", code, verdict))


def _leaves(values: Mapping[str, Any], *above: str) -> Iterator[tuple[str, ...]]:
    """Where the plain values of nested names are."""
    for name, value in values.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, *above, str(name))
        else:
            yield (*above, str(name))
