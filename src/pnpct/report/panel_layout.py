"""Images in rows and columns: where everything stands, before anything is drawn."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from pnpct.arrays import Image
from pnpct.comparison import Detail
from pnpct.files import check_window
from pnpct.report.words import spell_exactly
from pnpct.units import to_hu

Greys = NDArray[np.uint8]

SIDE = 512.0
"""Width of a panel."""

GAP, MARGIN, HEADER, FOOTER = 8.0, 56.0, 64.0, 88.0
"""Between panels, left of them for the names of the rows, above them for the names of the columns, below them."""

ENLARGED = 3.0

LARGEST = 36.0
"""Height of letters."""

COLOURS = ("#ffd23f", "#5ec8ff", "#ff8fd0", "#8ce99a")


@dataclass(frozen=True)
class PanelRow:
    """One case: its images beside each other.

    Args:
        label: What stands beside the row.
        images: Images of one shape, attenuation relative to water, by the name of their column.
        details: Squares that are enlarged below each image.
    """

    label: str
    images: Mapping[str, Image]
    details: Sequence[Detail] = ()

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of its images."""
        rows, cols = next(iter(self.images.values())).shape
        return rows, cols

    @property
    def enlargement(self) -> float:
        """How much larger than in the panel a detail is: three times, or less where the details fill the row."""
        sides = sum(detail.size for detail in self.details)
        return min(ENLARGED, self.shape[1] / sides) if sides else ENLARGED


@dataclass(frozen=True)
class Tile:
    """A picture of greys, and the colour of its frame."""

    left: float
    top: float
    width: float
    height: float
    greys: Greys
    frame: str = ""


@dataclass(frozen=True)
class Box:
    """A square around a detail."""

    left: float
    top: float
    side: float
    colour: str


@dataclass(frozen=True)
class Label:
    """Words; `anchor` is "start", "middle" or "end", and `turned` ones run upwards."""

    x: float
    y: float
    text: str
    size: float
    anchor: str = "middle"
    turned: bool = False


@dataclass(frozen=True)
class Layout:
    """All of a picture."""

    width: float
    height: float
    tiles: tuple[Tile, ...]
    boxes: tuple[Box, ...]
    labels: tuple[Label, ...]


def lay_out(rows: Sequence[PanelRow], *, window: tuple[float, float]) -> Layout:
    """Place rows of images, their names, boxes and enlarged details, and a scale of grey.

    Args:
        rows: The cases; a column that a row lacks stays empty.
        window: Level and width of the window, HU.

    Raises:
        ValueError: If there is no image, or the window has no width.
    """
    if not rows or not all(row.images for row in rows):
        raise ValueError("A picture of panels needs at least one image in each row, got none.")
    check_window(window)
    names = [*dict.fromkeys(name for row in rows for name in row.images)]
    left = {name: MARGIN + number * (SIDE + GAP) for number, name in enumerate(names)}
    tiles: list[Tile] = []
    boxes: list[Box] = []
    size = _fitting(names)
    labels = [Label(left[name] + SIDE / 2, HEADER / 2, name, size) for name in names]
    top = HEADER
    for row in rows:
        for name, image in row.images.items():
            tiles += _tiles(row, _greys(image, window), left[name], top)
            boxes += _boxes(row, left[name], top)
        labels.append(Label(MARGIN / 2, top + _panel_height(row) / 2, row.label, LARGEST, turned=True))
        top += _height(row) + GAP
    width = MARGIN + len(names) * (SIDE + GAP)
    tiles.append(Tile(MARGIN, top + 12, SIDE, 14, np.arange(256, dtype=np.uint8)[None, :], frame="#808080"))
    labels += _scale_labels(rows, top, window)
    return Layout(width, top + FOOTER, tuple(tiles), tuple(boxes), tuple(labels))


def _panel_height(row: PanelRow) -> float:
    return SIDE * row.shape[0] / row.shape[1]


def _height(row: PanelRow) -> float:
    """Height of a row with its enlarged details."""
    scale = SIDE / row.shape[1] * row.enlargement
    enlarged = max((detail.size for detail in row.details), default=0) * scale
    return _panel_height(row) + (enlarged + GAP / 2 if enlarged else 0.0)


def _tiles(row: PanelRow, greys: Greys, left: float, top: float) -> Iterator[Tile]:
    height = _panel_height(row)
    yield Tile(left, top, SIDE, height, greys)
    for detail, colour in zip(row.details, _colours(row), strict=True):
        side = detail.size * SIDE / row.shape[1] * row.enlargement
        part = greys[detail.row : detail.row + detail.size, detail.col : detail.col + detail.size]
        yield Tile(left, top + height + GAP / 2, side, side, part, frame=colour)
        left += side


def _boxes(row: PanelRow, left: float, top: float) -> Iterator[Box]:
    scale = SIDE / row.shape[1]
    for detail, colour in zip(row.details, _colours(row), strict=True):
        yield Box(left + detail.col * scale, top + detail.row * scale, detail.size * scale, colour)


def _colours(row: PanelRow) -> list[str]:
    return [COLOURS[number % len(COLOURS)] for number in range(len(row.details))]


def _fitting(names: Sequence[str]) -> float:
    """Height of letters, which are about half as wide, so that the longest name fits over a panel."""
    return min(LARGEST, SIDE / (0.55 * max(1, *map(len, names))))


def _scale_labels(rows: Sequence[PanelRow], top: float, window: tuple[float, float]) -> Iterator[Label]:
    level, width = window
    for place, anchor, value in ((0.0, "start", -0.5), (0.5, "middle", 0.0), (1.0, "end", 0.5)):
        yield Label(MARGIN + place * SIDE, top + 52, f"{spell_exactly(level + value * width)} HU", 28.0, anchor)
    words = f"window: level {spell_exactly(level)} HU, width {spell_exactly(width)} HU"
    enlarged = sorted({f"{row.enlargement:.2g}" for row in rows if row.details})
    words += f"; details enlarged {' or '.join(enlarged)} times" if enlarged else ""
    yield Label(MARGIN + SIDE + 24, top + 20, words, 28.0, "start")


def _greys(image: Image, window: tuple[float, float]) -> Greys:
    level, width = window
    shown = ((to_hu(image.double()) - level) / width + 0.5).clamp(0.0, 1.0)
    return np.asarray((255 * shown).round().to(torch.uint8))
