"""The page in a browser: opened from the disk, without a network."""

import re
import shutil
from pathlib import Path

import pytest
import torch
from small_comparison import PROVENANCE

from pnpct.files import read_image, write_image
from pnpct.report import write_report
from pnpct.units import to_hu

pytestmark = pytest.mark.slow  # a browser takes its time on a busy machine

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
TIMEOUT_MS = 120_000  # machines that are busy with other things start a browser slowly


@pytest.fixture(scope="module")
def browser():
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    program = next(filter(None, map(shutil.which, BROWSERS)), None)
    if program is None:
        pytest.skip(f"there is no browser here: none of {', '.join(BROWSERS)} is in PATH")
    with playwright.sync_playwright() as started:
        browser = started.chromium.launch(
            executable_path=program, args=["--no-sandbox", "--disable-gpu"], timeout=TIMEOUT_MS
        )
        yield browser
        browser.close()


@pytest.fixture
def open_page(browser):
    """Open a page with the network off; at the end nothing may have gone wrong, or have been asked for."""
    contexts, complaints, requests = [], [], []

    def open_page(path: Path, *, width: int = 1360, scheme: str = "light"):
        context = browser.new_context(viewport={"width": width, "height": 900}, color_scheme=scheme, offline=True)
        context.set_default_timeout(TIMEOUT_MS)
        contexts.append(context)
        page = context.new_page()
        page.on("console", lambda message: complaints.append(message.text) if ours(message) else None)
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("request", lambda request: requests.append(request.url))
        page.goto(path.as_uri())
        page.wait_for_selector("html[data-ready]")
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
    """Whether a message is about the page; that reading pixels back is slow is about these tests."""
    return "willReadFrequently" not in message.text


def settle(page):
    """Wait until what has changed is drawn."""
    page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def colour(page, canvas: str, col: int, row: int) -> list[int]:
    """Red, green and blue in the middle of an image pixel, where the whole image is in view."""
    settle(page)
    return page.evaluate(
        """([canvas, col, row]) => {
            const found = document.querySelector(canvas);
            const [x, y] = [(col + 0.5) * found.width / 64, (row + 0.5) * found.height / 64];
            return [...found.getContext("2d").getImageData(x, y, 1, 1).data.slice(0, 3)];
        }""",
        [canvas, col, row],
    )


def panel(method: str) -> str:
    return f'#grid .panel[data-method="{method}"] canvas'


def point_of(page, selector: str, col: float, row: float) -> tuple[float, float]:
    """Where an image pixel is on the screen."""
    page.locator(selector).scroll_into_view_if_needed()
    box = page.locator(selector).bounding_box()
    return box["x"] + (col + 0.5) * box["width"] / 64, box["y"] + (row + 0.5) * box["height"] / 64


def grey(value: float, level: float, width: float) -> list[int]:
    shown = min(1.0, max(0.0, (value - level) / width + 0.5))
    return [int(255 * shown + 0.5)] * 3


def set_slider(page, name: str, value: int):
    page.locator(f"#{name}").evaluate(
        "(slider, value) => { slider.value = value; slider.dispatchEvent(new Event('input')); }", value
    )


PIXELS = [(20, 20), (25, 50), (44, 24), (0, 0), (33, 12)]


def test_images_are_drawn_through_the_window_and_the_slider_moves_it(page, hu):
    for level, width in ((30, 300), (-100, 300), (-100, 80)):
        set_slider(page, "level", level)
        set_slider(page, "width", width)
        for method, image in hu.items():
            for col, row in PIXELS:
                expected = grey(float(image[row, col]), level, width)
                assert colour(page, panel(method), col, row) == expected, (method, col, row)
        assert page.locator("#level-says").text_content() == f"{level} HU".replace("-", "−")


def test_a_preset_sets_the_window(page, hu):
    page.get_by_role("button", name="Lung").click()
    assert colour(page, panel("fbp"), 20, 20) == grey(float(hu["fbp"][20, 20]), -600, 1500)
    assert page.get_by_role("button", name="Lung").get_attribute("aria-pressed") == "true"


def test_dragging_sets_the_window(page):
    x, y = point_of(page, panel("pnp"), 20, 20)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 60, y, steps=3)
    page.mouse.up()
    settle(page)
    width = int(page.locator("#width").input_value())
    assert width == pytest.approx(300 * 2.71828**0.2, abs=2)
    assert page.locator("#level").input_value() == "30"
    page.mouse.down()
    page.mouse.move(x + 60, y + 60, steps=3)
    page.mouse.up()
    settle(page)
    assert int(page.locator("#level").input_value()) == pytest.approx(30 + 60 * width / 300, abs=1)


def test_every_panel_reads_the_hu_under_the_pointer(page, hu):
    for col, row in PIXELS:
        page.mouse.move(*point_of(page, panel("fbp"), col, row))
        settle(page)
        for method, image in hu.items():
            said = page.locator(f'#grid .panel[data-method="{method}"] output').text_content()
            assert said == f"{image[row, col]:.0f} HU".replace("-", "−"), (method, col, row)
    place = page.locator("#place").text_content()
    # Row 12 and column 33 on a grid of 4 mm around (10, −20) mm.
    assert place == "column 33, row 12 · x 16.0 mm, y 58.0 mm"


def test_keys_move_the_crosshair_and_say_what_is_there(page, hu):
    page.locator("#grid").focus()
    page.keyboard.press("ArrowRight")
    page.keyboard.press("Shift+ArrowUp")
    page.keyboard.press("ArrowLeft")
    settle(page)
    assert page.locator("#place").text_content().startswith("column 32, row 22 ")
    said = page.locator("#said").text_content().replace("−", "-")
    assert f"FBP {hu['fbp'][22, 32]:.0f} HU" in said
    assert f"Truth {hu['truth'][22, 32]:.0f} HU" in said
    assert page.locator("#said").get_attribute("aria-live") == "polite"
    page.keyboard.press("3")
    settle(page)
    assert (page.locator("#level").input_value(), page.locator("#width").input_value()) == ("-600", "1500")


def test_the_wheel_scrolls_the_page_until_the_images_are_clicked(page):
    point = point_of(page, panel("fbp"), 20, 20)
    page.mouse.move(*point)
    before = page.evaluate("scrollY")
    page.mouse.wheel(0, 60)
    while page.evaluate("scrollY") == before:
        settle(page)
    point = point_of(page, panel("fbp"), 20, 20)
    page.mouse.click(*point)
    before = page.evaluate("scrollY")
    page.mouse.wheel(0, -600)
    settle(page)
    page.mouse.move(point[0] + 30, point[1])
    settle(page)
    assert page.evaluate("scrollY") == before
    # e^(600/500) times larger: what was 30 dots away is fewer pixels away.
    width = page.locator(panel("fbp")).bounding_box()["width"]
    col = int(re.match(r"column (\d+)", page.locator("#place").text_content())[1])
    assert col == int(20.5 + 30 / (width / 64 * 3.3201))


def test_all_panels_zoom_together_and_come_back(page, hu):
    page.locator("#grid").focus()
    before = {method: colour(page, panel(method), 25, 50) for method in hu}
    page.keyboard.press("+")
    page.keyboard.press("+")
    page.keyboard.press("d")
    assert any(colour(page, panel(method), 25, 50) != before[method] for method in hu)
    page.mouse.move(*point_of(page, panel("fbp"), 32, 32))
    settle(page)
    one = page.locator("#place").text_content()
    page.mouse.move(*point_of(page, panel("truth"), 32, 32))
    settle(page)
    assert page.locator("#place").text_content() == one
    page.mouse.move(0, 0)
    page.keyboard.press("0")
    page.mouse.move(*point_of(page, panel("truth"), 0, 0))
    assert {method: colour(page, panel(method), 25, 50) for method in hu} == before


def test_the_divider_shows_one_method_left_and_the_other_right(page, hu):
    canvas = "#pair canvas"
    assert (page.locator("#pair-a").input_value(), page.locator("#pair-b").input_value()) == ("fbp", "pnp")
    x, y = point_of(page, canvas, 31.5, 10)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(point_of(page, canvas, 15.5, 10)[0], y, steps=4)
    page.mouse.up()
    settle(page)
    assert page.locator("#swipe").input_value() == "25"
    assert page.locator("#width").input_value() == "300"  # the drag was of the divider, not of the window
    page.mouse.move(0, 0)
    for col, method in ((12, "fbp"), (20, "pnp"), (25, "pnp")):
        assert colour(page, canvas, col, 50) == grey(float(hu[method][50, col]), 30, 300)
    page.locator("#pair-b").select_option("truth")
    assert colour(page, canvas, 25, 50) == grey(float(hu["truth"][50, 25]), 30, 300)


def test_flicker_shows_one_after_the_other(page, hu):
    page.locator("#pair-modes").get_by_text("Flicker").click()
    left, right = page.locator("#pair-left"), page.locator("#pair-right")
    right.filter(has_text="PnP-ADMM").wait_for()
    left.filter(has_text="FBP").wait_for()
    page.locator("#flip").click()  # also ends the changing
    settle(page)
    shown = "fbp" if left.text_content() == "FBP" else "pnp"
    assert (left.text_content(), right.text_content()) in [("FBP", ""), ("", "PnP-ADMM")]
    assert colour(page, "#pair canvas", 25, 50) == grey(float(hu[shown][50, 25]), 30, 300)


def test_differences_are_white_at_0_and_blue_and_red_beyond(page, hu):
    page.locator("#modes").get_by_text("Minus truth").click()
    assert colour(page, panel("truth"), 25, 50) == [247, 247, 247]
    difference = hu["fbp"] - hu["truth"]
    for sign, low, high in ((-1, 0, 2), (1, 2, 0)):
        row, col = divmod(int((sign * difference).argmax()), 64)
        assert abs(float(difference[row, col])) > 60
        seen = colour(page, panel("fbp"), col, row)
        assert seen[high] > seen[low] + 50
    page.mouse.move(*point_of(page, panel("fbp"), 25, 50))
    settle(page)
    said = page.locator('#grid .panel[data-method="fbp"] output').text_content().replace("−", "-")
    assert f"Δ {difference[50, 25]:+.0f}" in said


def test_an_overlay_covers_the_image_and_is_read(page, hu):
    before = colour(page, panel("pnp"), 60, 50)
    page.locator("#overlays").get_by_text("Score t").click()
    page.locator("#scale-high").filter(has_text="(t)").wait_for()
    assert colour(page, panel("pnp"), 60, 50) != before
    assert colour(page, panel("fbp"), 60, 50) == grey(float(hu["fbp"][50, 60]), 30, 300)
    page.mouse.move(*point_of(page, panel("pnp"), 60, 50))
    settle(page)
    said = page.locator('#grid .panel[data-method="pnp"] output').text_content()
    assert said.endswith(f" · {-4.0 + 12.0 * 60 / 63:.2f}")


def test_another_case_has_other_images_and_no_maps(page, folder):
    page.locator("#cases").get_by_text("Head, 60 mA").click()
    page.wait_for_selector('html[data-ready="head"]')
    image = to_hu(read_image(folder / "head-fbp.h5")[0].double()).round()
    assert colour(page, panel("fbp"), 25, 50) == grey(float(image[50, 25]), 30, 300)
    assert page.locator('input[name="overlay"][value="t"]').is_disabled()
    assert page.locator("#detail-rows h3").text_content().startswith("1: Head, 60 mA, rows 26 to 41")


def test_a_profile_is_the_hu_along_the_line(page, hu):
    page.locator("#drags").get_by_text("draws the profile").click()
    x, y = point_of(page, panel("fbp"), 4, 60)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(*point_of(page, panel("fbp"), 60, 60), steps=3)
    page.mouse.up()
    settle(page)
    assert page.locator("#profile-says").text_content().startswith("Chest, 40 mA: 224.0 mm from column 4, row 60 ")
    heights = page.locator('#profile [data-method="fbp"] polyline').get_attribute("points").split()
    drawn = torch.tensor([float(point.split(",")[1]) for point in heights[::2]], dtype=torch.float64)
    along = hu["fbp"][60, 4:61]
    # A straight line from HU to height: up is more.
    slope = (drawn[-1] - drawn[0]) / (along[-1] - along[0])
    assert slope < 0
    torch.testing.assert_close(drawn, drawn[0] + slope * (along - along[0]), atol=0.2, rtol=0)
    page.locator("#line-0-1").fill("10")
    settle(page)
    assert "from column 4, row 10 " in page.locator("#profile-says").text_content()


def background(page) -> float:
    return sum(map(int, re.findall(r"\d+", page.evaluate("getComputedStyle(document.body).backgroundColor"))[:3]))


def test_dark_is_the_systems_choice_until_the_reader_makes_another(open_page, report):
    for scheme in ("light", "dark"):
        page = open_page(report, scheme=scheme)
        dark = background(page) < 200
        assert dark == (scheme == "dark")
        button = page.locator("#theme")
        assert button.get_attribute("aria-pressed") == str(dark).lower()
        button.click()
        assert (background(page) < 200) != dark
        assert button.get_attribute("aria-pressed") == str(not dark).lower()
        page.emulate_media(media="print")
        assert background(page) > 700  # paper is white


def test_a_failure_can_be_seen_on_the_screen_and_on_paper(page):
    for media in ("screen", "print"):
        page.emulate_media(media=media)
        assert page.locator(".failure").is_visible()
        assert page.locator(".failure").bounding_box()["height"] > 20
    page.emulate_media(media="screen")
    assert page.locator(".verdict.fail").is_visible()


def test_a_changed_image_says_so_under_itself(open_page, own_folder, tmp_path):
    image, grid = read_image(own_folder / "chest-pnp.h5")
    write_image(own_folder / "chest-pnp.h5", image + 0.001, grid, provenance=PROVENANCE)
    write_report(own_folder, tmp_path / "report.html")
    page = open_page(tmp_path / "report.html")
    caption = page.locator('#grid .panel[data-method="pnp"] figcaption')
    assert "FAIL: changed since it was measured" in caption.text_content()
    assert "FAIL" not in page.locator('#grid .panel[data-method="fbp"] figcaption').text_content()


@pytest.mark.parametrize("width", [360, 768, 1920])
def test_nothing_is_wider_than_the_window(open_page, report, width):
    page = open_page(report, width=width)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.locator(panel("fbp")).bounding_box()["width"] >= 140


def test_everything_can_be_reached_by_the_tab_key(page):
    reached = set()
    for _ in range(90):
        page.keyboard.press("Tab")
        reached.add(
            page.evaluate("document.activeElement.id || document.activeElement.name || document.activeElement.tagName")
        )
    wanted = {"theme", "case", "level", "width", "mode", "overlay", "drag", "grid", "pair", "pair-a", "pair-b", "swipe"}
    assert wanted <= reached
