"""Draw the picture of the conventions from the positions that the library itself computes.

    python docs/images/make_geometry.py

writes geometry.png beside this file. It needs matplotlib, which is among the development tools.
"""

import math
import sys
from pathlib import Path
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Circle, Rectangle

from pnpct.geometry import FanBeam, ImageGrid

BETA = math.radians(40)
GRID = ImageGrid(6, 6, spacing=60.0)
BLUE, RED, GREY, GREEN = "#1f5fa8", "#b03030", "#888888", "#2f7d4f"


def scanner(detector: Literal["arc", "flat"]) -> FanBeam:
    """A scanner with few and wide bins, once at the top and once at β."""
    return FanBeam(
        view_angles=[0.0, BETA],
        bins=7,
        source_to_isocenter=541.0,
        source_to_detector=949.0,
        bin_width=120.0,
        detector=detector,
    )


def arrow(axes: Any, start: Any, end: Any, color: str) -> None:
    """Draw an arrow from `start` to `end`."""
    look = {"arrowstyle": "-|>", "color": color, "lw": 1.4, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", end, start, arrowprops=look)


def draw_image(axes: Any) -> None:
    """The pixels, with row 0 and column 0, and the two axes."""
    half = GRID.cols * GRID.spacing / 2
    for x in GRID.x:
        for y in GRID.y:
            first = x == GRID.x[0] or y == GRID.y[0]
            corner = (x - GRID.spacing / 2, y - GRID.spacing / 2)
            axes.add_patch(
                Rectangle(
                    corner, GRID.spacing, GRID.spacing, facecolor="#dce9dc" if first else "white", edgecolor=GREEN
                )
            )
    axes.text(GRID.x[-1] + 45, GRID.y[0], "row 0", color=GREEN, va="center")
    axes.text(GRID.x[0], GRID.y[-1] - 45, "column 0", color=GREEN, ha="center", va="top")
    arrow(axes, (0, 0), (half + 130, 0), "black")
    arrow(axes, (0, 0), (0, half + 130), "black")
    axes.text(half + 140, 0, "+x", va="center")
    axes.text(0, half + 140, "+y", ha="center")


def draw_scanner(axes: Any, geometry: FanBeam) -> None:
    """The fan at view β, the focal spot at view 0, and the angles."""
    top, spot = geometry.focal_spots()
    # Seen from the focal spot, R goes as far as the isocentre and D as far as the detector.
    for name, length in (("R", 0.42 * geometry.source_to_isocenter), ("D", 0.87 * geometry.source_to_detector)):
        at = spot + length * np.array([math.sin(BETA), -math.cos(BETA)])
        axes.text(*(at - [26, 26]), name, color=BLUE, ha="center", va="center")
    axes.add_patch(Circle((0, 0), geometry.source_to_isocenter, fill=False, linestyle=":", edgecolor=GREY))
    axes.plot(*top, "o", color=GREY, markersize=5)
    axes.text(top[0] + 20, top[1] + 15, "focal spot at β = 0", color=GREY)
    axes.plot(*spot, "o", color=BLUE, markersize=7)
    axes.text(spot[0] - 30, spot[1] + 25, "focal spot\nat (−R sin β, R cos β)", color=BLUE, ha="right", va="bottom")
    axes.plot([0, top[0]], [0, top[1]], color=GREY, lw=0.8, linestyle="--")
    axes.add_patch(Arc((0, 0), 620, 620, theta1=90, theta2=90 + math.degrees(BETA), color=BLUE, lw=1.4))
    tip = [310 * np.array([-math.sin(b), math.cos(b)]) for b in (BETA - 0.04, BETA)]
    arrow(axes, tip[0], tip[1], BLUE)
    axes.text(*(360 * np.array([-math.sin(BETA / 2), math.cos(BETA / 2)])), "β", color=BLUE, ha="center", fontsize=13)

    edges = geometry.detector_points(geometry.fan_angle_edges)[1]
    fine = np.linspace(geometry.fan_angle_edges[0], geometry.fan_angle_edges[-1], 200)
    axes.plot(*geometry.detector_points(fine)[1].T, color=RED, lw=3, solid_capstyle="butt")
    outward = (edges - spot) / np.linalg.norm(edges - spot, axis=1, keepdims=True)
    for edge, direction in zip(edges, outward, strict=True):
        axes.plot(*np.stack([edge - 14 * direction, edge + 14 * direction]).T, color=RED, lw=1.2)
    for edge in (edges[0], edges[-1]):
        axes.plot(*np.stack([spot, edge]).T, color=BLUE, lw=0.7)
    central = geometry.detector_points(np.zeros(1))[1, 0]
    axes.plot(*np.stack([spot, central]).T, color=BLUE, lw=0.9, linestyle="--")
    centers = geometry.detector_points(geometry.fan_angles)[1]
    for number in range(geometry.bins):
        direction = (centers[number] - spot) / np.linalg.norm(centers[number] - spot)
        label = f"bin {number}" if number in (0, geometry.bins - 1) else str(number)
        axes.text(*(centers[number] + 52 * direction), label, color=RED, ha="center", va="center")

    gamma = geometry.fan_angles[5]
    axes.plot(*np.stack([spot, centers[5]]).T, color=RED, lw=0.9)
    sweep = np.linspace(0, gamma, 30)
    curve = spot + 790 * np.stack([np.sin(BETA + sweep), -np.cos(BETA + sweep)], axis=1)
    axes.plot(*curve.T, color=RED, lw=1.4)
    arrow(axes, curve[-2], curve[-1], RED)
    axes.text(*(curve[15] + 50 * np.array([math.sin(BETA), -math.cos(BETA)])), "γ", color=RED, ha="center", fontsize=13)


def main(path: Path) -> None:
    """Draw both detectors side by side."""
    mpl.rcParams.update({"font.size": 9, "axes.titlesize": 11})
    figure = Figure(figsize=(10, 5), layout="tight")
    for axes, detector in zip(figure.subplots(1, 2), ("arc", "flat"), strict=True):
        draw_image(axes)
        draw_scanner(axes, scanner(detector))
        axes.set_title(f'detector="{detector}"')
        axes.set_aspect("equal")
        axes.set_xlim(-680, 640)
        axes.set_ylim(-620, 620)
        axes.set_axis_off()
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_name("geometry.png"))
