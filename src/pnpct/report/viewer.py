"""What the viewer of a page must know, and the pixels that it shows."""

import json
from collections.abc import Sequence
from typing import Any

from markupsafe import Markup

from pnpct.comparison import Case, Comparison
from pnpct.report.images import FoundImage
from pnpct.report.results import Results
from pnpct.report.words import title_of, unit_of

PRESETS = (
    ("Soft tissue", 30.0, 300.0),
    ("Abdomen", 40.0, 400.0),
    ("Lung", -600.0, 1500.0),
    ("Bone", 400.0, 1800.0),
    ("Brain", 40.0, 80.0),
)
"""Windows that a reader may choose: name, level and width in HU."""

MAPS = {"t": "Score t", "verifiable_hu": "Verifiable contrast, HU", "difference_hu": "Change by the prior, HU"}
"""How usual maps are called; others by their names."""

ENDS = {"t": 8.0}
"""Where the colours of a map end whatever its numbers are; those of others end at the largest number of the case."""


def map_titles(comparison: Comparison) -> list[tuple[str, str]]:
    """Return the maps that some image has, and what they are called."""
    names = dict.fromkeys(name for case in comparison.cases for maps in case.maps.values() for name in maps)
    return [(name, MAPS.get(name, f"{title_of(name)} {unit_of(name)}".strip())) for name in names]


def viewer_data(results: Results, images: Sequence[FoundImage], *, window: tuple[float, float]) -> Markup:
    """Return JSON for the viewer that is safe inside an element of a page.

    Args:
        results: The comparison.
        images: Its images, in the order in which their pixels follow.
        window: Level and width at first, HU.
    """
    content = {
        "window": window,
        "methods": [
            {"name": name, "label": label, "style": results.styles[name]} for name, label in results.labels.items()
        ],
        "cases": [_case(case, results.order(case), images) for case in results.comparison.cases],
    }
    # What could end the element or begin another is written as JSON allows.
    safe = json.dumps(content, ensure_ascii=False, separators=(",", ":")).replace("<", "\\u003c")
    return Markup(safe)


def pixel_id(image: FoundImage) -> str:
    """Return the name of the element that holds the pixels of an image: alike ones share it."""
    return f"pixels-{'map' if image.shows else 'image'}-{image.sha256[:20]}"


def pixel_texts(images: Sequence[FoundImage]) -> tuple[dict[str, str], dict[str, str]]:
    """Return the pixels as texts by the names of their elements: those of the first case, and those of the others."""
    first = {pixel_id(image): image.packed.text for image in images if image.case == images[0].case}
    return first, {name: image.packed.text for image in images if (name := pixel_id(image)) not in first}


def _case(case: Case, order: Sequence[str], images: Sequence[FoundImage]) -> dict[str, Any]:
    stored: dict[str, dict[str, Any]] = {name: {"maps": {}} for name in order}
    for image in images:
        if image.case == case.name:
            pixels = {"pixels": pixel_id(image), "step": image.packed.step, "changed": image.changed}
            if image.shows:
                stored[image.method]["maps"][image.shows] = {**pixels, "side": image.packed.side}
            else:
                stored[image.method].update(pixels)
    return {
        "name": case.name,
        "label": case.label,
        "rows": case.grid.rows,
        "cols": case.grid.cols,
        "spacing": case.grid.spacing,
        "center": case.grid.center,
        "details": [[detail.row, detail.col, detail.size] for detail in case.details],
        "order": list(order),
        "images": stored,
        "scales": _scales([image for image in images if image.case == case.name and image.shows]),
    }


def _scales(maps: Sequence[FoundImage]) -> dict[str, dict[str, Any]]:
    """One scale for all maps of a case that show the same, so that a colour means one number on every image."""
    scales = {}
    for shows in dict.fromkeys(each.shows for each in maps):
        alike = [each.packed for each in maps if each.shows == shows]
        low, high = min(each.low for each in alike), max(each.high for each in alike)
        largest = max(-low, high)
        end = ENDS.get(shows, largest or 1.0)
        scales[shows] = {"signed": shows in ENDS or low < 0, "largest": end, "beyond": largest > end}
    return scales
