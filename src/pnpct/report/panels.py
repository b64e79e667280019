"""Images side by side as a picture for papers and slides, PNG or SVG."""

import base64
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from PIL import Image as Picture
from PIL import ImageDraw, ImageFont
from PIL.PngImagePlugin import PngInfo

from pnpct.comparison import Comparison
from pnpct.files import Provenance, atomic_path
from pnpct.report.environment import environment
from pnpct.report.images import columns, labels, read_shown
from pnpct.report.panel_layout import Greys, Label, Layout, PanelRow, Tile, lay_out

WINDOW = (30.0, 300.0)
"""Level and width, HU."""

_PLAIN = str.maketrans({"−": "-", "–": "-", "×": "x", "²": "2", "σ": "sigma", "\u202f": " ", "′": "'"})
"""Pillow's own font lacks these."""

_ANCHORS: dict[str, Literal["lm", "mm", "rm"]] = {"start": "lm", "middle": "mm", "end": "rm"}


def write_panels(
    path: Path, rows: Sequence[PanelRow], *, provenance: Provenance, window: tuple[float, float] = WINDOW
) -> None:
    """Write images in rows and columns with their names, boxes around details, and these enlarged below.

    Args:
        path: Where the picture shall be: .png, or .svg with words and boxes that can be edited.
        rows: The cases.
        provenance: How the images were made; it is kept in the picture.
        window: Level and width of the window, HU.

    Raises:
        OSError: If the file cannot be written.
        ValueError: If the suffix is another, there is no image, or the window has no width.
    """
    if path.suffix.lower() not in (".png", ".svg"):
        raise ValueError(f"Panels are written as .png or .svg, got {path.name}.")
    layout = lay_out(rows, window=window)
    with atomic_path(path) as temporary:
        if path.suffix.lower() == ".png":
            text = PngInfo()
            text.add_itxt("Comment", provenance.to_json())
            _drawn(layout).save(temporary, pnginfo=text)
        else:
            temporary.write_text(_written(layout, provenance), encoding="utf-8")


def panel_rows(folder: Path, comparison: Comparison) -> tuple[PanelRow, ...]:
    """Read the images of a comparison as rows of panels: cases below each other, reference and truth last.

    Raises:
        OSError: If an image is missing or cannot be read.
        ValueError: If one has not the size of its case.
    """
    names = labels(comparison)
    return tuple(
        PanelRow(
            case.label,
            {names[method]: read_shown(folder, case, method) for method in columns(comparison, case)},
            case.details,
        )
        for case in comparison.cases
    )


def _drawn(layout: Layout) -> Picture.Image:
    picture = Picture.new("RGB", (round(layout.width), round(layout.height)), "white")
    pen = ImageDraw.Draw(picture)
    for tile in layout.tiles:
        size = round(tile.width), round(tile.height)
        panel = Picture.fromarray(tile.greys).resize(size, Picture.Resampling.BICUBIC)
        picture.paste(panel, (round(tile.left), round(tile.top)))
        if tile.frame:
            pen.rectangle(_corners(tile), outline=tile.frame, width=2)
    for box in layout.boxes:
        corners = (box.left, box.top, box.left + box.side - 1, box.top + box.side - 1)
        pen.rectangle(corners, outline=box.colour, width=2)
    for label in layout.labels:
        _write(picture, label)
    return picture


def _corners(tile: Tile) -> tuple[float, float, float, float]:
    return tile.left, tile.top, tile.left + tile.width - 1, tile.top + tile.height - 1


def _write(picture: Picture.Image, label: Label) -> None:
    font, text = ImageFont.load_default(size=label.size), label.text.translate(_PLAIN)
    if not label.turned:
        ImageDraw.Draw(picture).text((label.x, label.y), text, fill="black", font=font, anchor=_ANCHORS[label.anchor])
        return
    length, height = round(font.getlength(text)) + 2, round(1.5 * label.size)
    strip = Picture.new("RGB", (length, height), "white")
    ImageDraw.Draw(strip).text((length / 2, height / 2), text, fill="black", font=font, anchor="mm")
    picture.paste(strip.rotate(90, expand=True), (round(label.x - height / 2), round(label.y - length / 2)))


def _written(layout: Layout, provenance: Provenance) -> str:
    template = environment().get_template("panels.svg.j2")
    tiles = [(tile, _as_data(tile.greys)) for tile in layout.tiles]
    return template.render(layout=layout, tiles=tiles, provenance=provenance.to_json())


def _as_data(greys: Greys) -> str:
    """A PNG inside a link: no pixel is lost, and the SVG needs no other file."""
    content = io.BytesIO()
    Picture.fromarray(greys).save(content, format="PNG", optimize=True)
    return "data:image/png;base64," + base64.b64encode(content.getvalue()).decode("ascii")
