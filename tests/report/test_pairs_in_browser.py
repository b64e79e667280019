"""The page in a browser: pairs of images, differences, overlays, profiles, colours, keys."""

import re

import pytest
import torch
from browser_page import colour, grey, panel, point_of, settle
from small_comparison import PROVENANCE

from pnpct.files import read_image, write_image
from pnpct.report import write_report
from pnpct.units import to_hu

pytestmark = pytest.mark.slow  # a browser takes its time on a busy machine


def test_the_divider_shows_one_method_left_and_the_other_right(page, hu):
    canvas = "#pair canvas"
    assert (page.locator("#pair-a").input_value(), page.locator("#pair-b").input_value()) == ("truth", "pnp")
    page.locator("#pair-a").select_option("fbp")
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
    page.locator("#pair-a").select_option("fbp")
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
    assert colour(page, panel("truth"), 60, 50) == grey(float(hu["truth"][50, 60]), 30, 300)
    page.mouse.move(*point_of(page, panel("pnp"), 60, 50))
    settle(page)
    said = page.locator('#grid .panel[data-method="pnp"] output').text_content()
    assert said.endswith(f" · {-4.0 + 12.0 * 60 / 63:.2f}")


def test_a_colour_means_one_number_on_every_image(page):
    page.locator("#overlays").get_by_text("Score t").click()
    page.locator("#scale-high").filter(has_text="8 and more (t)").wait_for()
    assert page.locator("#scale-low").text_content() == "−8 and more"
    # −3.81 in both maps, on black; the largest number of one is 16, that of the other 8.
    assert colour(page, panel("pnp"), 1, 50) == pytest.approx(colour(page, panel("fbp-blurred"), 11, 50), abs=3)
    assert colour(page, panel("fbp-blurred"), 60, 50) == colour(page, panel("fbp-blurred"), 63, 50)  # the end is 8
    page.locator("#overlays").get_by_text("Verifiable contrast").click()
    page.locator("#scale-high").filter(has_text="38 (verifiable hu)").wait_for()
    assert colour(page, panel("pnp"), 60, 50) == colour(page, panel("fbp"), 60, 50)


def test_where_a_map_has_no_answer_the_image_is_seen(page, hu):
    before = colour(page, panel("pnp"), 60, 50)
    for overlay, name in (("Score t", "t"), ("Verifiable contrast", "verifiable hu"), ("Change by", "difference hu")):
        page.locator("#overlays").get_by_text(overlay).click()
        page.locator("#scale-high").filter(has_text=f"({name})").wait_for()
        assert colour(page, panel("pnp"), 60, 50) != before
        assert colour(page, panel("pnp"), 30, 2) == grey(float(hu["pnp"][2, 30]), 30, 300)
    page.mouse.move(*point_of(page, panel("pnp"), 30, 2))
    settle(page)
    assert page.locator('#grid .panel[data-method="pnp"] output').text_content().endswith(" HU · not known")


def test_a_coarse_map_lies_where_its_pixels_are(open_page, folder, tmp_path, monkeypatch):
    monkeypatch.setattr("pnpct.report.pixels.MAP_SIDE", 32)
    write_report(folder, tmp_path / "report.html")
    page = open_page(tmp_path / "report.html")
    page.locator("#overlays").get_by_text("Score t").click()
    page.locator("#scale-high").filter(has_text="(t)").wait_for()
    assert colour(page, panel("pnp"), 60, 50) == colour(page, panel("pnp"), 61, 50) != colour(page, panel("pnp"), 0, 50)
    page.mouse.move(*point_of(page, panel("pnp"), 60, 50))
    settle(page)
    said = page.locator('#grid .panel[data-method="pnp"] output').text_content()
    assert said.endswith(f" · {-4.0 + 12.0 * 61 / 63:.2f}")  # of columns 60 and 61 that farther from 0


def test_another_case_has_other_images_and_no_maps(page, folder):
    page.locator("#cases").get_by_text("Head, 60 mA").click()
    page.wait_for_selector('html[data-ready="head"]')
    image = to_hu(read_image(folder / "head-fbp.h5")[0].double()).round()
    assert colour(page, panel("fbp"), 25, 50) == grey(float(image[50, 25]), 30, 300)
    assert page.locator('input[name="overlay"][value="t"]').is_disabled()
    assert page.locator("#detail-rows h3").text_content().startswith("1: rows 26 to 41")


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
    page.locator("#cases").get_by_text("Head, 60 mA").click()
    page.wait_for_selector('html[data-ready="head"]')
    settle(page)
    assert page.locator("#profile-says").text_content().startswith("Head, 60 mA: 300.3 mm from column 4, row 10 ")


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


def test_checks_are_folded_on_the_screen_and_open_on_paper(page):
    check = page.locator(".check").filter(has_text="The prior has overruled the data.")
    assert not check.is_visible()
    assert page.locator(".summary .mark.fail").first.is_visible()
    page.emulate_media(media="print")
    assert check.is_visible()
    assert check.bounding_box()["height"] > 20
    page.emulate_media(media="screen")
    page.locator(".method > summary").filter(has_text="PnP-ADMM").click()
    assert check.is_visible()


def test_the_first_two_images_are_large_on_a_desk_and_side_by_side_on_a_phone(open_page, report):
    for width, times in ((1440, 2), (390, 1)):
        page = open_page(report, width=width)
        truth, best, other = (page.locator(panel(name)).bounding_box() for name in ("truth", "pnp", "fbp"))
        assert truth["y"] == best["y"]
        assert truth["x"] < best["x"]
        assert truth["width"] == pytest.approx(best["width"], abs=1)
        assert truth["width"] == pytest.approx(times * other["width"], rel=0.05)


def test_a_changed_image_says_so_under_itself(open_page, own_folder, tmp_path):
    image, grid = read_image(own_folder / "chest-pnp.h5")
    write_image(own_folder / "chest-pnp.h5", image + 0.001, grid, provenance=PROVENANCE)
    write_report(own_folder, tmp_path / "report.html")
    page = open_page(tmp_path / "report.html")
    caption = page.locator('#grid .panel[data-method="pnp"] figcaption')
    assert "FAIL: changed since it was measured" in caption.text_content()
    assert "FAIL" not in page.locator('#grid .panel[data-method="fbp"] figcaption').text_content()


@pytest.mark.parametrize("width", [360, 768, 1440, 1920])
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
