"""Images side by side as a figure, for papers, slides and notebooks."""

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from pnpct.arrays import Image
from pnpct.comparison import Comparison, Detail
from pnpct.files import Provenance, atomic_path, check_window
from pnpct.geometry.short_repr import short_repr
from pnpct.report.images import columns, labels, read_shown
from pnpct.report.words import spell_exactly
from pnpct.units import to_hu

WINDOW = (30.0, 300.0)
"""Level and width, HU."""

SIDE, LARGEST = 5.12, 26.0
"""Width of a panel in inches, at 100 dots each, and the largest letters in points."""

ENLARGED = 3.0

COLOURS = ("#ffd23f", "#5ec8ff", "#ff8fd0", "#8ce99a")

_LOOK: dict[Any, Any] = {
    "svg.fonttype": "none",
    "text.parse_math": False,
    "font.sans-serif": ["Helvetica", "Arial", "DejaVu Sans"],
}


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

    __repr__ = short_repr

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

    @property
    def heights(self) -> tuple[float, float]:
        """Height of a panel and of the enlarged details below it, as shares of its width."""
        largest = max((detail.size for detail in self.details), default=0)
        return self.shape[0] / self.shape[1], self.enlargement * largest / self.shape[1]


class Picture(Figure):
    """A figure that a notebook shows, whether or not it draws inline."""

    def _repr_png_(self) -> bytes:
        content = io.BytesIO()
        self.savefig(content, format="png", dpi=50)
        return content.getvalue()


def draw_panels(rows: Sequence[PanelRow], *, window: tuple[float, float] = WINDOW) -> Picture:
    """Draw images in rows and columns with their names, boxes around details, these enlarged below, and a scale.

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
    heights = [max(height, 1e-3) for row in rows for height in row.heights]
    with mpl.rc_context(_LOOK):
        figure = Picture(figsize=(SIDE * len(names) + 0.6, SIDE * sum(heights) + 1.6), dpi=100, facecolor="white")
        space = {"left": 0.6 / figure.get_figwidth(), "right": 1.0, "wspace": 0.02, "hspace": 0.02}
        space |= {"bottom": 1.0 / figure.get_figheight(), "top": 1 - 0.6 / figure.get_figheight()}
        grid = figure.add_gridspec(len(heights), len(names), height_ratios=heights, **space)
        size = min(LARGEST, 0.9 * 72 * SIDE / (0.55 * max(1, *map(len, names))))
        for number, row in enumerate(rows):
            for column, name in enumerate(names):
                panel, below = (figure.add_subplot(grid[2 * number + k, column]) for k in (0, 1))
                if number == 0:
                    panel.set_title(name, fontsize=size)
                if column == 0:
                    panel.set_ylabel(row.label, fontsize=LARGEST)
                for axes in (panel, below):
                    axes.set(xticks=[], yticks=[], frame_on=False)
                if name in row.images:
                    _draw(row, row.images[name], panel, below, window)
        _draw_scale(figure, rows, window)
    return figure


def write_panels(
    path: Path, rows: Sequence[PanelRow], *, provenance: Provenance, window: tuple[float, float] = WINDOW
) -> None:
    """Write the figure of `draw_panels`.

    Args:
        path: Where the picture shall be: .png, or .svg with words and boxes that can be edited.
        rows: The cases.
        provenance: How the images were made; it is kept in the picture.
        window: Level and width of the window, HU.

    Raises:
        OSError: If the file cannot be written.
        ValueError: If the suffix is another, there is no image, or the window has no width.
    """
    kind = path.suffix.lower().removeprefix(".")
    if kind not in ("png", "svg"):
        raise ValueError(f"Panels are written as .png or .svg, got {path.name}.")
    figure = draw_panels(rows, window=window)
    about = {"Comment": provenance.to_json()} if kind == "png" else {"Description": provenance.to_json(), "Date": None}
    with atomic_path(path) as temporary, mpl.rc_context({**_LOOK, "svg.hashsalt": "panels"}):
        figure.savefig(temporary, format=kind, metadata=about)


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


def _draw(row: PanelRow, image: Image, panel: Axes, below: Axes, window: tuple[float, float]) -> None:
    level, width = window
    hu = to_hu(image.double()).cpu().numpy()
    look: dict[str, Any] = {
        "cmap": "gray",
        "vmin": level - width / 2,
        "vmax": level + width / 2,
        "interpolation": "none",
    }
    panel.imshow(hu, **look)
    left = 0.0
    for number, detail in enumerate(row.details):
        colour, side = COLOURS[number % len(COLOURS)], row.enlargement * detail.size / row.shape[1]
        corner = detail.col - 0.5, detail.row - 0.5
        panel.add_patch(Rectangle(corner, detail.size, detail.size, fill=False, edgecolor=colour, linewidth=1.5))
        enlarged = below.inset_axes((left, 0.0, side, 1.0), xticks=[], yticks=[])
        enlarged.imshow(hu[detail.row : detail.row + detail.size, detail.col : detail.col + detail.size], **look)
        for spine in enlarged.spines.values():
            spine.set(edgecolor=colour, linewidth=2)
        left += side


def _draw_scale(figure: Figure, rows: Sequence[PanelRow], window: tuple[float, float]) -> None:
    level, width = window
    shades = mpl.cm.ScalarMappable(mpl.colors.Normalize(level - width / 2, level + width / 2), "gray")
    place = (0.6 / figure.get_figwidth(), 0.7 / figure.get_figheight())
    axes = figure.add_axes((*place, SIDE / figure.get_figwidth(), 0.15 / figure.get_figheight()))
    ends = [level + share * width for share in (-0.5, 0.0, 0.5)]
    bar = figure.colorbar(shades, cax=axes, orientation="horizontal", ticks=ends)
    bar.ax.set_xticklabels([f"{spell_exactly(end)} HU" for end in ends], fontsize=18)
    first, _, last = bar.ax.get_xticklabels()
    first.set_horizontalalignment("left")
    last.set_horizontalalignment("right")
    words = f"window: level {spell_exactly(level)} HU, width {spell_exactly(width)} HU"
    enlarged = sorted({f"{row.enlargement:.2g}" for row in rows if row.details})
    words += f"; details enlarged {' or '.join(enlarged)} times" if enlarged else ""
    axes.text(1.04, 0.5, words, transform=axes.transAxes, va="center", fontsize=18)
