"""What a reader meets before anything is unfolded: seven methods at three doses on a desk and on a phone."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest
from browser_page import settle
from small_comparison import LESION, METHODS, NAMES, make_comparison

from pnpct.comparison import Check, Comparison, write_comparison
from pnpct.report import write_report

pytestmark = pytest.mark.slow  # a browser takes its time on a busy machine

LABELS = (
    "FBP, hann",
    "FBP, blurred by 1.5 pixels",
    "PnP, two-stage",
    "PnP, supervised",
    "TV-PWLS",
    "supervised",
    "nlm",
)
DOSES = (40, 70, 100)
CHECKS = (
    *("residual chi-square", "residual correlation along views", "residual correlation along bins"),
    *("largest score", "cross-view score", "lesion recovery", "error against FBP"),
)
SAYS = (
    "At (191, −22) mm the data want +61 HU more in a disc of 8 mm; they can tell 78 HU there, and the truth is off too."
)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    folder = tmp_path_factory.mktemp("seven")
    write_comparison(folder, widened(make_comparison(folder)))
    write_report(folder, folder / "report.html")
    return folder / "report.html"


def source(number: int) -> str:
    """The method of the small comparison whose numbers a method has: no other is a baseline or a control."""
    return NAMES[number] if number < len(NAMES) else "pnp"


def spread(of: Mapping[str, Any]) -> dict[str, Any]:
    """What three methods have, for seven."""
    given = {name: value for name, value in of.items() if name not in NAMES}
    return {**{f"m{n}": of[source(n)] for n in range(len(LABELS)) if source(n) in of}, **given}


def each(records: tuple[Any, ...]) -> tuple[Any, ...]:
    return tuple(replace(r, method=f"m{n}") for r in records for n in range(len(LABELS)) if r.method == source(n))


def widened(small: Comparison) -> Comparison:
    """The small comparison with seven methods and three cases, and something in every section."""
    case, _ = small.cases
    names = [f"abdomen-{dose}mA" for dose in DOSES]
    methods = (
        *(replace(method, name=f"m{n}", label=LABELS[n]) for n, method in enumerate(METHODS)),
        *(replace(METHODS[2], name=f"m{n}", label=LABELS[n], role="compared") for n in range(3, len(LABELS))),
    )
    group = small.texture_change["40 mA"]
    group = replace(group, changes=spread(group.changes), ranking=tuple(spread(group.changes)))
    lesions = {name: replace(found, lesion=LESION) for name, found in small.lesions["chest"].items()}
    return Comparison(
        small.provenance,
        small.definitions,
        methods,
        tuple(
            replace(
                case,
                name=name,
                label=f"abdomen-000-row00, {dose} mA, 120 kVp",
                tube_current_ma=float(dose),
                images=spread(case.images),
                maps=spread(case.maps),
            )
            for name, dose in zip(names, DOSES, strict=True)
        ),
        fidelity=dict.fromkeys(names, spread(small.fidelity["chest"])),
        texture=dict.fromkeys(names, spread(small.texture["chest"])),
        texture_change={f"{dose} mA": group for dose in DOSES},
        histogram=dict.fromkeys(names, spread(small.histogram["chest"])),
        curves=each(small.curves),
        tasks=each(tuple(task for task in small.tasks if task.observer != "NPWE")),
        least_reductions=each(small.least_reductions),
        lesions=dict.fromkeys(names, spread(lesions)),
        checks=tuple(
            Check(check, name, f"m{n}", 1.2, 0.9, 1.1, "fail", SAYS)
            for n in range(len(LABELS))
            for name in names
            for check in CHECKS
        ),
    )


def test_seven_methods_at_three_doses_are_at_most_5000_dots_on_a_desk(open_page, path):
    page = open_page(path, width=1440)
    page.evaluate("for (const fold of document.querySelectorAll('#images details')) fold.open = false")
    settle(page)
    assert {section.get_attribute("id") for section in page.locator("section").all()} >= {
        "curves",
        "texture",
        "numbers",
    }
    assert page.evaluate("document.documentElement.scrollHeight") <= 5000
    image = page.locator("#grid").bounding_box()
    assert image["y"] < 300  # the images come first
    assert page.locator("table.summary").bounding_box()["y"] < 1200


def test_on_a_phone_the_first_chart_and_the_first_case_of_the_checks_are_seen_whole(open_page, path):
    page = open_page(path, width=390)
    page.evaluate("for (const fold of document.querySelectorAll('details')) fold.open = true")
    settle(page)
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    for part in ("#lesions .strip .plot", "#curves .chart .plot", ".checks tbody td"):
        box = page.locator(part).first.bounding_box()
        assert box["x"] + box["width"] <= 390, part
    head, first, second = (page.locator("#lesions .bars li").nth(n).bounding_box() for n in (0, 1, 2))
    assert second["y"] - first["y"] == first["y"] - head["y"] == 28  # beside their bars
    heights = page.locator("#lesions .bars li").evaluate_all("all => all.map((name) => name.scrollHeight)")
    assert max(heights) <= 28
