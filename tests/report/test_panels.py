import base64
import io
import json
from xml.etree import ElementTree

import numpy as np
import pytest
import torch
from PIL import Image as Picture
from PIL import ImageFont

from pnpct.comparison import Detail, read_comparison
from pnpct.files import Provenance
from pnpct.report import PanelRow, panel_rows, write_panels
from pnpct.report.panel_layout import FOOTER, GAP, HEADER, MARGIN, SIDE, lay_out
from pnpct.units import from_hu

PROVENANCE = Provenance(["pnpct", "report"], "0.1.0")
WINDOW = (30.0, 300.0)
SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(scope="module")
def rows(folder):
    return panel_rows(folder, read_comparison(folder))


def test_rows_are_cases_and_columns_methods_with_the_truth_last(rows):
    assert [row.label for row in rows] == ["Chest, 40 mA", "Head, 60 mA"]
    for row in rows:
        assert [*row.images] == ["FBP", "Blurred FBP", "PnP-ADMM", "Reference", "Truth"]


def test_details_are_enlarged_three_times_unless_there_is_no_room():
    image = torch.ones(64, 64)
    assert PanelRow("", {"a": image}, [Detail(0, 0, 16)]).enlargement == 3.0
    assert PanelRow("", {"a": image}, [Detail(0, 0, 16), Detail(8, 8, 16)]).enlargement == 2.0
    layout = lay_out([PanelRow("", {"a": image}, [Detail(8, 16, 16)])], window=WINDOW)
    (box,) = layout.boxes
    panel, enlarged, _ = layout.tiles
    assert (box.left - panel.left, box.top - panel.top, box.side) == (SIDE / 4, SIDE / 8, SIDE / 4)
    assert enlarged.width == enlarged.height == 3 * box.side
    assert enlarged.top > panel.top + panel.height
    np.testing.assert_array_equal(enlarged.greys, panel.greys[8:24, 16:32])


def test_names_fit_over_their_panels():
    for name in ("FBP", "fbp-soft: 35.7 HU RMS error in soft tissue"):
        layout = lay_out([PanelRow("", {name: torch.ones(8, 8)})], window=WINDOW)
        (label,) = [label for label in layout.labels if label.text == name]
        assert ImageFont.load_default(size=label.size).getlength(name) < SIDE
        assert label.size > 20


def test_nothing_overlaps_and_all_is_inside(rows):
    layout = lay_out(rows, window=WINDOW)
    spans = [(tile.left, tile.top, tile.left + tile.width, tile.top + tile.height) for tile in layout.tiles]
    for number, (left, top, right, bottom) in enumerate(spans):
        assert 0 <= left < right <= layout.width
        assert 0 <= top < bottom <= layout.height
        for other_left, other_top, other_right, other_bottom in spans[:number]:
            apart = right <= other_left or other_right <= left or bottom <= other_top or other_bottom <= top
            assert apart


def test_greys_are_those_of_the_window():
    image = from_hu(torch.tensor([[-1000.0, -120.0], [29.0, 180.0]]))
    layout = lay_out([PanelRow("", {"a": image})], window=WINDOW)
    np.testing.assert_array_equal(layout.tiles[0].greys, [[0, 0], [127, 255]])
    texts = [label.text for label in layout.labels]
    assert {"−120 HU", "30 HU", "180 HU"} <= {*texts}
    assert any(text.startswith("window: level 30 HU, width 300 HU") for text in texts)


def test_the_png_has_the_panels_and_its_provenance(rows, tmp_path):
    write_panels(tmp_path / "panel.png", rows, provenance=PROVENANCE)
    with Picture.open(tmp_path / "panel.png") as picture:
        enlarged = 3 * 16 * SIDE / 64 + GAP / 2
        assert picture.width == MARGIN + 5 * (SIDE + GAP)
        assert picture.height == HEADER + 2 * (SIDE + enlarged + GAP) + FOOTER
        assert json.loads(picture.text["Comment"])["command"] == ["pnpct", "report"]
        # In the middle of the truth's panel there is water, 0 HU.
        left = round(MARGIN + 4 * (SIDE + GAP))
        assert picture.getpixel((left + 200, round(HEADER + SIDE / 2))) == (102, 102, 102)


def test_the_svg_has_every_pixel_and_words_that_can_be_edited(rows, tmp_path):
    write_panels(tmp_path / "panel.svg", rows, provenance=PROVENANCE)
    root = ElementTree.parse(tmp_path / "panel.svg").getroot()
    texts = [element.text for element in root.iter(f"{SVG}text")]
    assert texts[:5] == ["FBP", "Blurred FBP", "PnP-ADMM", "Reference", "Truth"]
    assert json.loads(root.find(f"{SVG}metadata").text)["version"] == "0.1.0"
    pictures = [element.attrib["href"] for element in root.iter(f"{SVG}image")]
    assert len(pictures) == 2 * (5 + 5) + 1  # panels and their details, the scale
    layout = lay_out(rows, window=WINDOW)
    for link, tile in zip(pictures, layout.tiles, strict=True):
        content = base64.b64decode(link.removeprefix("data:image/png;base64,"))
        np.testing.assert_array_equal(np.asarray(Picture.open(io.BytesIO(content))), tile.greys)
    boxes = [element for element in root.iter(f"{SVG}rect") if element.attrib.get("fill") == "none"]
    assert len(boxes) == 2 * (5 + 5) + 1


def test_names_cannot_become_markup(tmp_path):
    row = PanelRow("a < b", {"</text><script/>": torch.ones(8, 8)})
    write_panels(tmp_path / "panel.svg", [row], provenance=PROVENANCE)
    root = ElementTree.parse(tmp_path / "panel.svg").getroot()
    assert not [*root.iter(f"{SVG}script")]
    assert "</text><script/>" in [element.text for element in root.iter(f"{SVG}text")]


def test_a_case_may_lack_a_method():
    rows = [PanelRow("a", {"x": torch.ones(8, 8), "y": torch.ones(8, 8)}), PanelRow("b", {"y": torch.ones(8, 8)})]
    layout = lay_out(rows, window=WINDOW)
    assert [tile.left for tile in layout.tiles[:3]] == [MARGIN, MARGIN + SIDE + GAP, MARGIN + SIDE + GAP]


@pytest.mark.parametrize(
    ("name", "rows", "window", "message"),
    [
        ("panel.jpg", [PanelRow("", {"a": torch.ones(8, 8)})], WINDOW, r"\.png or \.svg, got panel\.jpg"),
        ("panel.png", [], WINDOW, "at least one image"),
        ("panel.png", [PanelRow("", {})], WINDOW, "at least one image"),
        ("panel.png", [PanelRow("", {"a": torch.ones(8, 8)})], (0.0, -1.0), r"positive width in HU, got \(0.0, -1.0\)"),
    ],
)
def test_what_cannot_be_drawn_is_refused(name, rows, window, message, tmp_path):
    with pytest.raises(ValueError, match=message):
        write_panels(tmp_path / name, rows, provenance=PROVENANCE, window=window)
    assert not [*tmp_path.iterdir()]
