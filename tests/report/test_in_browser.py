"""The page in a browser, opened from the disk without a network: one window for all images."""

import re

import pytest
from browser_page import colour, grey, panel, point_of, set_slider, settle

pytestmark = pytest.mark.slow  # a browser takes its time on a busy machine

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
