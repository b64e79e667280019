"""A look at a value in a notebook, or at a picture of it in a file."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeAlias

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle
from numpy.typing import NDArray
from torch import Tensor

from pnpct.arrays import Image
from pnpct.comparison import read_comparison
from pnpct.geometry import ConeBeam, FanBeam, Geometry
from pnpct.physics import Scan, Sinogram, take_log
from pnpct.reconstruction import Reconstruction
from pnpct.report.panels import WINDOW, PanelRow, Picture, draw_panels, panel_rows

Showable: TypeAlias = Tensor | Reconstruction | Mapping[str, Any] | Scan | Sinogram | Geometry | Path
"""Images relative to water, alone or by name; rays; a geometry; the folder of a comparison."""

MOST_SLICES = 5
"""So many slices of a volume are shown, evenly spaced from the lowest to the highest."""

RAYS, DETECTOR = "#1f5fa8", "#b03030"

_LOOK: dict[Any, Any] = {"font.size": 18, "lines.linewidth": 2.5, "text.parse_math": False}


def show(what: Showable, *, window: tuple[float, float] = WINDOW) -> Picture:
    """Draw a value: a notebook shows the figure that is returned, and `show(...).savefig("x.png")` writes it.

    Args:
        what: An image, a volume (five of its slices) or a reconstruction; several of these by name, which stand side by
            side; a scan or a sinogram, of several detector rows the middle one; a geometry, seen along the axis at its
            first view; or the folder of a comparison, a row for each scan.
        window: Level and width of images, HU.

    Raises:
        OSError: If a comparison cannot be read.
        TypeError: If it is something else.
        ValueError: If the window has no width, or there is no image.

    Example:
        >>> import torch
        >>> picture = show({"air": torch.zeros(8, 8), "water": torch.ones(8, 8)}, window=(0, 400))
        >>> picture.savefig("both.png")  # doctest: +SKIP
    """
    match what:
        case Path():
            return draw_panels(panel_rows(what, read_comparison(what)), window=window)
        case FanBeam() | ConeBeam():
            return _draw_geometry(what)
        case Scan():
            return _draw_rays(take_log(what), what.geometry)
        case Sinogram():
            return _draw_rays(what)
        case Mapping():
            images = {name: image for label, each in what.items() for name, image in _images(each, str(label)).items()}
            return draw_panels([PanelRow("", images)], window=window)
    return draw_panels([PanelRow("", _images(what, ""))], window=window)


def _images(what: Any, label: str) -> dict[str, Image]:
    """The planes of an image, by name."""
    if isinstance(what, Reconstruction):
        made_by = " with ".join(str(what.settings[key]) for key in ("method", "denoiser") if what.settings.get(key))
        return _images(what.image, label or made_by)
    if not isinstance(what, Tensor) or what.ndim not in (2, 3):
        raise TypeError(
            "An image, a volume, a reconstruction, a scan, a sinogram, a geometry or the folder of a comparison can be "
            f"shown, got {f'an array of {what.ndim} axes' if isinstance(what, Tensor) else type(what).__name__}."
        )
    if what.ndim == 2:
        return {label: what}
    chosen = dict.fromkeys(np.linspace(0, len(what) - 1, MOST_SLICES).round().astype(int).tolist())
    return {f"{label} slice {number}".strip(): what[number] for number in chosen}


@mpl.rc_context(_LOOK)
def _draw_rays(sinogram: Sinogram, geometry: Geometry | None = None) -> Picture:
    """The rays of a fan, view below view; where they are known, and in order, with their angles."""
    shape = sinogram.weights.range_shape
    rays = sinogram.line_integrals.detach().cpu().numpy().reshape(-1, *shape)[0]  # the first of a batch
    rays = rays[:, shape[1] // 2] if len(shape) == 3 else rays
    ends, names = (-0.5, rays.shape[1] - 0.5, rays.shape[0] - 0.5, -0.5), ("bin", "view")
    if geometry is not None:
        views = np.degrees(geometry.view_angles if isinstance(geometry, FanBeam) else geometry.trajectory.angles)
        if len(views) > 1 and ((np.diff(views) > 0).all() or (np.diff(views) < 0).all()):
            first, last = np.degrees(geometry.fan_angle_edges[[0, -1]])
            ends, names = (first, last, views[-1], views[0]), ("fan angle γ, degrees", "view angle β, degrees")
    picture = _sheet(11.0, 8.0)
    axes = picture.subplots()
    axes.set(xlabel=names[0], ylabel=names[1])
    drawn = axes.imshow(rays, cmap="gray", aspect="auto", extent=ends, interpolation="none")
    picture.colorbar(drawn, label="line integral")
    return picture


@mpl.rc_context(_LOOK)
def _draw_geometry(geometry: Geometry) -> Picture:
    """Focal spots, the fan of the first view with its detector, and the field of view, along the axis."""
    picture = _sheet(10.0, 10.0)
    axes = picture.subplots()
    spots, edges = geometry.focal_spots()[:, :2], geometry.fan_angle_edges
    cells = geometry.detector_points(np.linspace(edges[0], edges[-1], 100))[0, :, :2]
    _line(axes, spots, ".", RAYS, "focal spot of each view")
    for end in (cells[0], cells[-1]):
        _line(axes, np.stack([spots[0], end]), "-", RAYS)
    _line(axes, cells, "-", DETECTOR, "detector at the first view")
    axes.add_patch(Circle((0, 0), geometry.field_of_view_radius, fill=False, ls="--", ec="0.5", label="field of view"))
    axes.set(xlabel="x, mm", ylabel="y, mm", aspect="equal")
    axes.set_title(str(geometry), fontsize=18)
    axes.legend(loc="upper left", bbox_to_anchor=(0, -0.12), ncols=3, fontsize=14, columnspacing=1, frameon=False)
    return picture


def _line(axes: Axes, points: NDArray[np.float64], style: str, colour: str, label: str | None = None) -> None:
    axes.plot(*points.T, style, color=colour, markersize=5, label=label)


def _sheet(width: float, height: float) -> Picture:
    return Picture(figsize=(width, height), dpi=100, layout="constrained", facecolor="white")
