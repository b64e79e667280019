"""Solids by the lines that their slices show: outlines, sheets and shells."""

import itertools
from collections.abc import Sequence

import numpy as np
from scipy.interpolate import PchipInterpolator

from pnpct.simulation.anatomy.painted_body import Layer
from pnpct.simulation.anatomy.shapes import Array, Point, Shape
from pnpct.simulation.anatomy.tissues import Tissue


def outline(*stations: tuple[float, Sequence[tuple[float, float]]]) -> Shape:
    """Return a solid by the corners of its slices, rounded off.

    Args:
        stations: Heights, growing, mm, with the corners x and y of the slice there, in order; as many corners
            everywhere, and they are joined smoothly from height to height. The solid ends flat.
    """
    heights = np.array([z for z, _ in stations])
    corners = np.array([each for _, each in stations], dtype=float)
    along = PchipInterpolator(heights, corners)

    def distance(x: Array, y: Array, z: float) -> Array:
        ring = _rounded(along(min(max(z, heights[0]), heights[-1])))
        square = np.full(np.broadcast_shapes(x.shape, y.shape), np.inf, dtype=np.float32)
        inside = np.zeros(square.shape, dtype=bool)
        for (x0, y0), (x1, y1) in zip(ring.tolist(), np.roll(ring, -1, axis=0).tolist(), strict=True):
            dx, dy, px, py = x1 - x0, y1 - y0, x - x0, y - y0
            t = np.clip((px * dx + py * dy) * (1 / max(dx * dx + dy * dy, 1e-9)), 0.0, 1.0)
            square = np.minimum(square, (px - t * dx) ** 2 + (py - t * dy) ** 2)
            if dy != 0:
                inside ^= ((y0 > y) != (y1 > y)) & (px < dx / dy * py)
        signed: Array = np.where(inside, -1, 1) * np.sqrt(square)
        solid: Array = np.maximum(signed, max(heights[0] - z, z - heights[-1]))
        return solid

    (x0, y0), (x1, y1) = corners.min(axis=(0, 1)).tolist(), corners.max(axis=(0, 1)).tolist()
    return Shape(distance, (x0, y0, float(heights[0])), (x1, y1, float(heights[-1])))


def _rounded(corners: Array) -> Array:
    """Cut every corner once (Chaikin)."""
    after = np.roll(corners, -1, axis=0)
    return np.stack([0.75 * corners + 0.25 * after, 0.25 * corners + 0.75 * after], axis=1).reshape(-1, 2)


def sheet(*stations: tuple[float, Sequence[Point]], smoothing: float = 3.0) -> Shape:
    """Return a plate or a muscle that is a thick line in every slice.

    Args:
        stations: Heights, growing, mm, with points x, y and half the thickness there, in order along the line;
            as many points everywhere, joined smoothly from height to height. The solid ends flat.
        smoothing: Width over which bends are rounded, mm.
    """
    heights = np.array([z for z, _ in stations])
    points = np.array([each for _, each in stations], dtype=float)
    along = PchipInterpolator(heights, points)

    def distance(x: Array, y: Array, z: float) -> Array:
        line = _curved(along(min(max(z, heights[0]), heights[-1]))).tolist()
        together: Array | None = None
        for (x0, y0, r0), (x1, y1, r1) in itertools.pairwise(line):
            dx, dy = x1 - x0, y1 - y0
            t = np.clip(((x - x0) * dx + (y - y0) * dy) * (1 / max(dx * dx + dy * dy, 1e-9)), 0.0, 1.0)
            other = np.sqrt((x - x0 - t * dx) ** 2 + (y - y0 - t * dy) ** 2) - r0 - t * (r1 - r0)
            if together is None:
                together = other
            else:
                overlap = np.maximum(smoothing - np.abs(together - other), 0.0) * (1 / max(smoothing, 1e-6))
                together = np.minimum(together, other) - overlap**2 * (smoothing / 4)
        if together is None:
            raise ValueError("A sheet needs at least two points at every height, got fewer.")
        solid: Array = np.maximum(together, max(heights[0] - z, z - heights[-1]))
        return solid

    thick = float(points[..., 2].max()) + smoothing
    (x0, y0, _), (x1, y1, _) = points.min(axis=(0, 1)).tolist(), points.max(axis=(0, 1)).tolist()
    return Shape(
        distance,
        (x0 - thick, y0 - thick, float(heights[0])),
        (x1 + thick, y1 + thick, float(heights[-1])),
    )


def _curved(line: Array) -> Array:
    """Put a point in the middle of each segment so that the line bends smoothly."""
    if len(line) < 3:
        return line
    padded = np.concatenate((2 * line[:1] - line[1:2], line, 2 * line[-1:] - line[-2:-1]))
    between = (9 * (padded[1:-2] + padded[2:-1]) - padded[:-3] - padded[3:]) / 16
    curved = np.empty((2 * len(line) - 1, line.shape[1]))
    curved[::2], curved[1::2] = line, between
    return curved


def shell(shape: Shape, thickness: float, tissue: Tissue, *, opacity: float = 0.5) -> Layer:
    """Return a thin skin on a solid, such as a fascia in fat."""
    wide = shape.grown(thickness)
    skin = Shape(lambda x, y, z: np.abs(shape.distance(x, y, z)) - thickness / 2, wide.low, wide.high)
    return Layer(skin, tissue, opacity)
