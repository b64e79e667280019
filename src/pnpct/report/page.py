"""A comparison as one HTML page that needs nothing else: no network, no library."""

import base64
import hashlib
from pathlib import Path
from typing import Any

import msgspec
from markupsafe import Markup

from pnpct.comparison import Comparison, read_comparison
from pnpct.files import atomic_path, check_window
from pnpct.report import curve_charts, header, lesion_charts, task_charts, texture_charts
from pnpct.report.charts import legend_of
from pnpct.report.dose_words import dose_statements
from pnpct.report.environment import environment, text_of
from pnpct.report.images import FoundImage, checks_of_images, columns, find_images, labels
from pnpct.report.marked_numbers import Numbers
from pnpct.report.styles import styles_of
from pnpct.report.tables import case_tables
from pnpct.report.viewer import MAPS, PRESETS, pixel_texts, viewer_data
from pnpct.report.words import title_of, unit_of

STYLES = ("tokens", "layout", "tables", "viewer", "charts", "print")
SCRIPTS = (
    "pixels",
    "colours",
    "state",
    "picture",
    "marks",
    "gestures",
    "keyboard",
    "controls",
    "panels",
    "pair",
    "details",
    "profile",
    "theme",
    "main",
)


def write_report(folder: Path, path: Path, *, window: tuple[float, float] = (30.0, 300.0)) -> int:
    """Write what a comparison has found as one HTML page, to be opened from the disk.

    The page shows the numbers of `metrics.json` and none besides; each names its place there. An image that is not
    the one that was measured fails a check that the page adds.

    Args:
        folder: Folder of the comparison.
        path: Where the page shall be, .html.
        window: Level and width of the window in which images are shown at first, HU.

    Returns:
        Number of checks that failed, those of changed images included.

    Raises:
        OSError: If something is missing or cannot be read, or the page cannot be written.
        FileFormatError: If a file is not what it should be.
        ValueError: If an image has not the size of its case, or the window has no width.
    """
    check_window(window)
    comparison = read_comparison(folder)
    images = find_images(folder, comparison)
    content = _content(comparison, images, window)
    page = environment().get_template("page.html.j2").render(content)
    with atomic_path(path) as temporary:
        temporary.write_text(page, encoding="utf-8")
    return int(content["counts"]["fail"])


def _content(comparison: Comparison, images: tuple[FoundImage, ...], window: tuple[float, float]) -> dict[str, Any]:
    """All that the templates show."""
    numbers, styles = Numbers(msgspec.to_builtins(comparison)), styles_of(comparison)
    all_lights = header.lights(comparison, checks_of_images(images), numbers)
    given = (comparison, numbers, styles)
    pixels_of_first_case, other_pixels = pixel_texts(images)
    script, style_sheet = _script(), _style_sheet()
    definitions = header.definition_rows(comparison, numbers)
    return {
        "comparison": comparison,
        "style_sheet": Markup(style_sheet),
        "style_hash": _hash(style_sheet),
        "script": Markup(script),
        "script_hash": _hash(script),
        "lights": all_lights,
        "lights_by_name": header.by_name(all_lights),
        "failures": header.failures(all_lights),
        "counts": header.counted(all_lights),
        "case_table": header.case_table(comparison, numbers),
        "method_table": header.method_table(*given),
        "numbers": numbers,
        "hashes": [(keys, value) for keys, value in definitions if keys.split(": ")[-1].endswith("hash")],
        "definitions": definitions,
        "fingerprints": header.fingerprint_table(comparison, images),
        "legend": _legend(comparison, styles),
        "legend_of": legend_of,
        "presets": PRESETS,
        "window": window,
        "maps": _maps(comparison),
        "viewer_data": viewer_data(comparison, images, styles, window=window),
        "pixels_of_first_case": pixels_of_first_case,
        "other_pixels": other_pixels,
        "curve_charts": curve_charts.curve_charts(*given),
        "curve_tables": curve_charts.curve_tables(*given),
        "change_groups": texture_charts.change_groups(*given),
        "histogram_charts": texture_charts.histogram_charts(*given),
        "fidelity_tables": case_tables(comparison, numbers, "fidelity", styles),
        "texture_tables": case_tables(comparison, numbers, "texture", styles),
        "histogram_tables": case_tables(comparison, numbers, "histogram", styles),
        "task_charts": task_charts.task_charts(*given),
        "task_tables": task_charts.task_tables(*given),
        "equal_dose": task_charts.equal_dose_table(*given),
        "dose_statements": dose_statements(comparison, numbers),
        "tasks_left_out": task_charts.left_out(comparison),
        "lesion_charts": lesion_charts.lesion_charts(*given),
        "lesion_table": lesion_charts.lesion_table(*given),
    }


def _legend(comparison: Comparison, styles: dict[str, str]) -> list[tuple[str, str]]:
    """What is drawn somewhere, with the classes of its colour."""
    shown = {name for case in comparison.cases for name in columns(comparison, case)}
    return [(label, styles[name]) for name, label in labels(comparison).items() if name in shown]


def _maps(comparison: Comparison) -> list[tuple[str, str]]:
    """The maps that some image has, and what they are called."""
    names = dict.fromkeys(name for case in comparison.cases for maps in case.maps.values() for name in maps)
    return [(name, MAPS.get(name, f"{title_of(name)} {unit_of(name)}".strip())) for name in names]


def _hash(text: str) -> str:
    """As a page's policy names what may run and what may style it."""
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode("ascii")


def _style_sheet() -> str:
    """All styles; the dark colours hold where the system or the reader asks for them, and never on paper."""
    dark = text_of("dark.css")
    by_system = f"@media screen and (prefers-color-scheme: dark) {{ :root:not([data-theme=light]) {{\n{dark}}} }}"
    by_reader = f"@media screen {{ :root[data-theme=dark] {{\n{dark}}} }}"
    tokens, *others = (text_of(f"{name}.css") for name in STYLES)
    return "\n".join([tokens, by_system, by_reader, *others])


def _script() -> str:
    """All scripts in one scope of their own."""
    return '"use strict";\n(() => {\n' + "\n".join(text_of(f"{name}.js") for name in SCRIPTS) + "})();\n"
