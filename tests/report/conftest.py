"""A small comparison, and a browser if there is one."""

import shutil
from pathlib import Path

import pytest
from small_comparison import make_comparison

from pnpct.files import read_image
from pnpct.report import write_report
from pnpct.units import to_hu

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
TIMEOUT_MS = 120_000  # machines that are busy with other things start a browser slowly


@pytest.fixture(scope="session")
def folder(tmp_path_factory) -> Path:
    """The folder of a comparison; tests that change it take a copy."""
    folder = tmp_path_factory.mktemp("comparison")
    make_comparison(folder)
    return folder


@pytest.fixture(scope="session")
def report(folder, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("report") / "report.html"
    write_report(folder, path)
    return path


@pytest.fixture
def own_folder(folder, tmp_path) -> Path:
    """A copy of the comparison that a test may change."""
    return Path(shutil.copytree(folder, tmp_path / "comparison"))


@pytest.fixture(scope="module")
def browser():
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    program = next(filter(None, map(shutil.which, BROWSERS)), None)
    if program is None:
        pytest.skip(f"there is no browser here: none of {', '.join(BROWSERS)} is in PATH")
    with playwright.sync_playwright() as started:
        browser = started.chromium.launch(
            executable_path=program,
            args=["--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader"],
            timeout=TIMEOUT_MS,
        )
        yield browser
        browser.close()


@pytest.fixture
def open_page(browser):
    """Open a page with the network off; at the end nothing may have gone wrong, or have been asked for."""
    contexts, complaints, requests = [], [], []

    def open_page(path: Path, *, width: int = 1900, scheme: str = "light"):
        context = browser.new_context(viewport={"width": width, "height": 900}, color_scheme=scheme, offline=True)
        context.set_default_timeout(TIMEOUT_MS)
        contexts.append(context)
        page = context.new_page()
        page.on("console", lambda message: complaints.append(message.text) if ours(message) else None)
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("request", lambda request: requests.append(request.url))
        page.goto(path.as_uri())
        page.wait_for_selector("html[data-ready]")
        page.evaluate("for (const fold of document.querySelectorAll('#images details')) fold.open = true")
        return page

    yield open_page
    opened = {page.url.partition("#")[0] for context in contexts for page in context.pages}
    for context in contexts:
        context.close()
    assert complaints == []
    assert {*requests} <= opened


@pytest.fixture
def page(open_page, report):
    return open_page(report)


@pytest.fixture(scope="module")
def hu(folder):
    """Whole HU of the first case by method."""
    names = ("fbp", "fbp-blurred", "pnp", "reference", "truth")
    return {name: to_hu(read_image(folder / f"chest-{name}.h5")[0].double()).round() for name in names}


def ours(message) -> bool:
    """Whether a message is about the page; that reading pixels back is slow is about these tests, and their machine."""
    return not any(slow in message.text for slow in ("willReadFrequently", "GPU stall due to ReadPixels"))
