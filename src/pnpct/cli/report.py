"""`pnpct report`: from a comparison to a page."""

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from tyro.conf import Positional

from pnpct.cli.artefact import check_output, finish
from pnpct.cli.terminal import working
from pnpct.comparison import RESULTS, read_comparison
from pnpct.files import atomic_path, record_run
from pnpct.report import panel_rows, write_panels, write_report


@dataclass(frozen=True)
class Report:
    """Show a comparison as one HTML page that works offline.

    The page shows the images, all numbers and the results of all checks. Beside it, panel.png and panel.svg show the
    images as a figure for a paper.

    Args:
        folder: Folder of the comparison, with metrics.json and the images.
        report: File for the page, .html.
        level: Level of the window in which the images are first shown, HU.
        width: Width of that window, HU.
    """

    folder: Positional[Path]
    report: Positional[Path | None] = None
    level: float = 30.0
    width: float = 300.0

    def run(self, command: Sequence[str]) -> None:
        """Read the comparison, and write the page and the panels."""
        page, results = self.report or self.folder / "report.html", self.folder / RESULTS
        panels = [page.with_name(name) for name in ("panel.png", "panel.svg")]
        for path, suffix in ((page, ".html"), *((panel, panel.suffix) for panel in panels)):
            check_output(path, (suffix,), inputs=[results])
        comparison, window = read_comparison(self.folder), (self.level, self.width)
        provenance = record_run(command, inputs=[results])
        with working("drawing"), ExitStack() as whole:
            # All of them or none: a page stays behind no failure of the panels.
            drawn_page, *drawn_panels = (whole.enter_context(atomic_path(path)) for path in (page, *panels))
            failed = write_report(self.folder, drawn_page, window=window)
            rows = panel_rows(self.folder, comparison)
            for panel in drawn_panels:
                write_panels(panel, rows, provenance=provenance, window=window)
        verdict = _count(failed, "failed check") if failed else "no failed check"
        finish(page, provenance, summary=f"{_count(len(comparison.cases), 'case')}, {verdict}")
        for panel in panels:
            finish(panel, provenance, summary="the images beside each other")


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"
