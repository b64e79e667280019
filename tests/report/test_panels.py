import base64
import io
import json
from xml.etree import ElementTree

import numpy as np
import pytest
import torch
from PIL import Image as Picture

from pnpct.comparison import Detail, read_comparison
from pnpct.files import Provenance
from pnpct.report import PanelRow, draw_panels, panel_rows, show, write_panels
from pnpct.units import from_hu, to_hu

PROVENANCE = Provenance(["pnpct", "report"], "0.1.0")
WINDOW = (30.0, 300.0)
SVG = "{http://www.w3.org/2000/svg}"
LINK = "{http://www.w3.org/1999/xlink}href"


@pytest.fixture(scope="module")
def rows(folder):
    return panel_rows(folder, read_comparison(folder))


def shown(figure):
    """All axes with an image, those inside others too, each with its place."""
    figure.canvas.draw()
    axes = [inner for outer in figure.axes for inner in (outer, *outer.child_axes)]
    return [(each, each.get_window_extent()) for each in axes if each.images]


def test_rows_are_cases_and_columns_methods_with_the_truth_last(folder, rows):
    assert [row.label for row in rows] == ["Chest, 40 mA", "Head, 60 mA"]
    for row in rows:
        assert [*row.images] == ["FBP", "Blurred FBP", "PnP-ADMM", "Reference", "Truth"]
    figure = show(folder)
    titles = [axes.get_title() for axes in figure.axes if axes.get_title()]
    assert titles == ["FBP", "Blurred FBP", "PnP-ADMM", "Reference", "Truth"]
    assert [axes.get_ylabel() for axes in figure.axes if axes.get_ylabel()] == ["Chest, 40 mA", "Head, 60 mA"]


def test_details_are_enlarged_three_times_unless_there_is_no_room():
    image = torch.arange(64.0 * 64).reshape(64, 64)
    assert PanelRow("", {"a": image}, [Detail(0, 0, 16)]).enlargement == 3.0
    assert PanelRow("", {"a": image}, [Detail(0, 0, 16), Detail(8, 8, 16)]).enlargement == 2.0
    (panel, place), (enlarged, inside) = shown(draw_panels([PanelRow("", {"a": image}, [Detail(8, 16, 16)])]))
    (box,) = panel.patches
    assert (box.get_xy(), box.get_width(), box.get_height()) == ((15.5, 7.5), 16, 16)
    assert inside.width == pytest.approx(3 * 16 / 64 * place.width, rel=0.02)
    assert inside.y1 < place.y0
    np.testing.assert_allclose(enlarged.images[0].get_array(), to_hu(image.double())[8:24, 16:32])


def test_names_fit_over_their_panels():
    for name in ("FBP", "fbp-soft: 35.7 HU RMS error in soft tissue"):
        figure = draw_panels([PanelRow("", {name: torch.ones(8, 8)})])
        ((axes, place),) = shown(figure)
        assert axes.title.get_window_extent().width < place.width
        assert axes.title.get_fontsize() > 12


def test_nothing_overlaps_and_all_is_inside(rows):
    figure = draw_panels(rows)
    spans = [place for _, place in shown(figure)]
    assert len(spans) == 2 * (5 + 5)
    for number, span in enumerate(spans):
        assert figure.bbox.x0 <= span.x0 < span.x1 <= figure.bbox.x1 + 1
        assert figure.bbox.y0 <= span.y0 < span.y1 <= figure.bbox.y1
        for other in spans[:number]:
            apart = span.x1 <= other.x0 or other.x1 <= span.x0 or span.y1 <= other.y0 or other.y1 <= span.y0
            assert apart


def test_greys_are_those_of_the_window():
    image = from_hu(torch.tensor([[-1000.0, -120.0], [29.0, 180.0]]))
    figure = draw_panels([PanelRow("", {"a": image})], window=WINDOW)
    ((axes, _),) = shown(figure)
    (drawn,) = axes.images
    np.testing.assert_array_equal(drawn.to_rgba(drawn.get_array(), bytes=True)[..., 0], [[0, 0], [127, 255]])
    texts = {text.get_text() for axes in figure.axes for text in (*axes.texts, *axes.get_xticklabels())}
    assert {"−120 HU", "30 HU", "180 HU"} <= texts
    assert any(text.startswith("window: level 30 HU, width 300 HU") for text in texts)


def test_the_png_has_the_panels_and_its_provenance(rows, tmp_path):
    write_panels(tmp_path / "panel.png", rows, provenance=PROVENANCE)
    with Picture.open(tmp_path / "panel.png") as picture:
        assert json.loads(picture.text["Comment"])["command"] == ["pnpct", "report"]
        truth = next(axes for axes in draw_panels(rows).axes if axes.get_title() == "Truth")
        place = truth.get_position()
        middle = (place.x0 + 0.4 * place.width) * picture.width, (1 - (place.y0 + place.y1) / 2) * picture.height
        assert picture.getpixel(tuple(map(round, middle)))[:3] == (102, 102, 102)  # water, 0 HU


def test_the_svg_has_every_pixel_and_words_that_can_be_edited(rows, tmp_path):
    write_panels(tmp_path / "panel.svg", rows, provenance=PROVENANCE)
    root = ElementTree.parse(tmp_path / "panel.svg").getroot()
    texts = [element.text for element in root.iter(f"{SVG}text")]
    assert {"FBP", "Blurred FBP", "PnP-ADMM", "Reference", "Truth", "Head, 60 mA"} <= {*texts}
    (said,) = [element.text for element in root.iter() if element.tag.endswith("}description")]
    assert json.loads(said)["version"] == "0.1.0"
    pictures = [element.attrib[LINK] for element in root.iter(f"{SVG}image")]
    sizes = [
        Picture.open(io.BytesIO(base64.b64decode(link.partition("base64,")[2].replace("\n", "")))).size
        for link in pictures
    ]
    assert sizes.count((64, 64)) == sizes.count((16, 16)) == 2 * 5  # panels and details, pixel by pixel


def test_names_cannot_become_markup(tmp_path):
    row = PanelRow("a < b", {"</text><script/>$x$": torch.ones(8, 8)})
    write_panels(tmp_path / "panel.svg", [row], provenance=PROVENANCE)
    root = ElementTree.parse(tmp_path / "panel.svg").getroot()
    assert not [*root.iter(f"{SVG}script")]
    assert "</text><script/>$x$" in [element.text for element in root.iter(f"{SVG}text")]


def test_a_case_may_lack_a_method():
    rows = [PanelRow("a", {"x": torch.ones(8, 8), "y": torch.ones(8, 8)}), PanelRow("b", {"y": torch.ones(8, 8)})]
    places = [place.x0 for _, place in shown(draw_panels(rows))]
    assert len(places) == 3
    assert places[1] == places[2] > places[0]


def test_a_notebook_shows_the_figure():
    png = draw_panels([PanelRow("", {"a": torch.ones(8, 8)})])._repr_png_()
    assert Picture.open(io.BytesIO(png)).format == "PNG"


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
