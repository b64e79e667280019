"""A comparison as one HTML page that needs nothing else: no network, no library."""

import base64
import hashlib
from pathlib import Path
from typing import Any

from markupsafe import Markup

from pnpct.comparison import read_comparison
from pnpct.files import atomic_path, check_window
from pnpct.report import bars, checks, curves, data, tasks
from pnpct.report.dose_words import dose_statements
from pnpct.report.environment import environment, text_of
from pnpct.report.images import FoundImage, checks_of_images, find_images
from pnpct.report.results import Results
from pnpct.report.summary import summary
from pnpct.report.tables import case_tables
from pnpct.report.viewer import PRESETS, map_titles, pixel_texts, viewer_data

STYLES = ("tokens", "layout", "tables", "viewer", "charts", "print")
SCRIPTS = (
    *("pixels", "colours", "state", "picture", "marks", "gestures", "keyboard", "controls", "panels", "pair"),
    *("details", "profile", "theme", "main"),
)
SECTIONS = {
    "images": "Images",
    "summary": "Summary",
    "checks": "Checks",
    "curves": "Noise, sharpness, detectability",
    "lesions": "Lesions",
    "texture": "Texture",
    "numbers": "Numbers",
    "data": "Data and methods",
    "limits": "Limits",
}
"""Names of the sections, as they follow each other, and what they are called in the bar."""


def write_report(folder: Path, path: Path, *, window: tuple[float, float] = (30.0, 300.0)) -> int:
    """Write what a comparison has found as one HTML page, to be opened from the disk.

    The page shows the numbers of `metrics.json` and none besides; in tables each names its place there. An image that
    is not the one that was measured fails a check that the page adds.

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
    results = Results(read_comparison(folder))
    images = find_images(folder, results.comparison)
    changed = checks_of_images(images)
    content = {**_facts(results, images), **_frame(results, images, window)}
    page = environment().get_template("page.html.j2").render(content, changed=changed, window=window)
    with atomic_path(path) as temporary:
        temporary.write_text(page, encoding="utf-8")
    return checks.counted([*results.comparison.checks, *changed])["fail"]


def _facts(results: Results, images: tuple[FoundImage, ...]) -> dict[str, Any]:
    """What the comparison has found, for the sections; those that have nothing to show are left out."""
    found: dict[str, Any] = {
        "method_checks": checks.method_checks(results, checks_of_images(images)),
        "summary": summary(results),
        "curve_charts": curves.curve_charts(results),
        "curve_tables": curves.curve_tables(results),
        "texture_changes": bars.texture_changes(results),
        "grey_values": bars.grey_values(results),
        "lesion_bars": bars.lesion_bars(results),
        "lesion_tables": bars.lesion_tables(results),
        "task_charts": tasks.task_charts(results),
        "task_tables": tasks.task_tables(results),
        "tasks_left_out": tasks.left_out(results),
        "equal_dose": tasks.equal_dose_table(results),
        "dose_statements": dose_statements(results),
        "number_tables": [
            table for part in ("fidelity", "texture", "histogram") for table in case_tables(results, part)
        ],
        "case_table": data.case_table(results),
        "method_table": data.method_table(results),
        "definitions": data.definition_rows(results),
        "fingerprints": data.fingerprint_tables(results, images),
    }
    shown = {
        "images": results.comparison.cases,
        "summary": found["summary"].measures,
        "checks": found["method_checks"],
        "curves": found["curve_charts"] or found["task_charts"] or found["tasks_left_out"],
        "lesions": found["lesion_bars"].charts,
        "texture": found["texture_changes"] or found["grey_values"].charts,
        "numbers": found["number_tables"],
    }
    return {**found, "sections": {name: title for name, title in SECTIONS.items() if shown.get(name, True)}}


def _frame(results: Results, images: tuple[FoundImage, ...], window: tuple[float, float]) -> dict[str, Any]:
    """What holds the page together: styles, scripts, pixels."""
    first, others = pixel_texts(images)
    script = _script()
    return {
        "results": results,
        "comparison": results.comparison,
        "numbers": results.numbers,
        **styled(),
        "script": Markup(script),
        "script_hash": _hash(script),
        "presets": PRESETS,
        "maps": map_titles(results.comparison),
        "viewer_data": viewer_data(results, images, window=window),
        "pixels_of_first_case": first,
        "other_pixels": others,
    }


def _hash(text: str) -> str:
    """As a page's policy names what may run and what may style it."""
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode("ascii")


def styled() -> dict[str, Markup | str]:
    """Return all styles with their hash, for a template; dark where the system or the reader asks for it."""
    dark = text_of("dark.css")
    by_system = f"@media screen and (prefers-color-scheme: dark) {{ :root:not([data-theme=light]) {{\n{dark}}} }}"
    by_reader = f"@media screen {{ :root[data-theme=dark] {{\n{dark}}} }}"
    tokens, *others = (text_of(f"{name}.css") for name in STYLES)
    styles = "\n".join([tokens, by_system, by_reader, *others])
    return {"style_sheet": Markup(styles), "style_hash": _hash(styles)}


def _script() -> str:
    """All scripts in one scope of their own."""
    return '"use strict";\n(() => {\n' + "\n".join(text_of(f"{name}.js") for name in SCRIPTS) + "})();\n"
