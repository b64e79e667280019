"""Draw the pictures of the report: what a reader sees first, on a desk and on a phone, and the small table in the dark.

    python docs/images/make_report.py comparison/

takes the folder that `pnpct compare` has written, makes its report in a temporary folder, opens that in a browser
(Chromium or Chrome, found in PATH) and writes report-*.png beside this file.
"""

import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

from PIL import Image as Picture
from playwright.sync_api import sync_playwright

from pnpct.report import write_report

HERE = Path(__file__).parent
BROWSERS = ("chromium", "chromium-browser", "google-chrome")

PICTURES = {
    "report-top": ("light", 1440, 1000, "#top"),
    "report-summary": ("dark", 1440, 820, "#summary"),
    "report-phone": ("light", 390, 820, "#top"),
}
"""Colours, width and height of the window in dots, and what is at its top."""


def take_pictures(report: Path, folder: Path, *, browser: str) -> None:
    """Open a report without a network, and write its pictures into a folder."""
    with sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=browser, args=["--no-sandbox"])
        page = started.new_context(offline=True).new_page()
        page.goto(report.as_uri())
        page.wait_for_selector("html[data-ready]")
        for name, (scheme, width, height, place) in PICTURES.items():
            _take(page, folder / f"{name}.png", scheme, width, height, place)
        started.close()


def _take(page: Any, path: Path, scheme: str, width: int, height: int, place: str) -> None:
    page.emulate_media(color_scheme=scheme)
    page.set_viewport_size({"width": width, "height": height})
    page.evaluate("(place) => document.querySelector(place).scrollIntoView({ behavior: 'instant' })", place)
    page.wait_for_timeout(500)  # until what came into view is drawn
    page.screenshot(path=path)
    with Picture.open(path) as picture:  # a palette is enough, and a third of the bytes
        palette = picture.convert("RGB").quantize(256, Picture.Quantize.MAXCOVERAGE, dither=Picture.Dither.NONE)
        palette.save(path, optimize=True)


def main() -> None:
    """Make the report and its pictures."""
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None or len(sys.argv) != 2:
        sys.exit("It needs the folder of a comparison, and Chromium or Chrome in PATH.")
    with tempfile.TemporaryDirectory() as temporary:
        report = Path(temporary) / "report.html"
        write_report(Path(sys.argv[1]), report)
        take_pictures(report, HERE, browser=browser)


if __name__ == "__main__":
    main()
