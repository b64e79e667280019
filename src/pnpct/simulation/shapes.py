"""Outlines as signed distances, from which anatomy is drawn."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.floating]


@dataclass(frozen=True)
class Shape:
    """A region of the plane by its signed distance: negative inside, positive outside, mm.

    Args:
        distance: From positions x and y, mm, to the signed distance, mm; right near the outline, at least in
            its sign elsewhere.
        center: Middle of a circle that holds the shape, mm.
        reach: Radius of that circle, mm.
    """

    distance: Callable[[Array, Array], Array]
    center: tuple[float, float]
    reach: float

    def grown(self, by: float) -> "Shape":
        """Move the outline outwards by a distance in mm; inwards if negative."""
        return Shape(lambda x, y: self.distance(x, y) - by, self.center, self.reach + by)

    def within(self, other: "Shape") -> "Shape":
        """Return what is in both shapes."""
        return Shape(lambda x, y: np.maximum(self.distance(x, y), other.distance(x, y)), self.center, self.reach)

    def without(self, other: "Shape") -> "Shape":
        """Return what is in this shape but not in the other."""
        return Shape(lambda x, y: np.maximum(self.distance(x, y), -other.distance(x, y)), self.center, self.reach)


def union(*shapes: Shape, smoothing: float = 0.0) -> Shape:
    """Return the union of shapes; concave corners are rounded over about `smoothing` mm."""
    centers = np.array([shape.center for shape in shapes])
    middle = centers.mean(axis=0)
    reach = max(float(np.hypot(*(shape.center - middle))) + shape.reach for shape in shapes)

    def distance(x: Array, y: Array) -> Array:
        together = shapes[0].distance(x, y)
        for shape in shapes[1:]:
            other = shape.distance(x, y)
            overlap = np.maximum(smoothing - np.abs(together - other), 0.0) / max(smoothing, 1e-6)
            together = np.minimum(together, other) - overlap**2 * (smoothing / 4)
        return together

    return Shape(distance, (float(middle[0]), float(middle[1])), reach + smoothing)


def ellipse(
    center: tuple[float, float], half_axes: tuple[float, float], *, angle: float = 0.0, power: float = 2.0
) -> Shape:
    """Return an ellipse, |x/a|^power + |y/b|^power < 1 in axes turned by `angle`, rad; above 2 it is boxy."""
    (a, b), cosine, sine = half_axes, np.cos(angle), np.sin(angle)

    def distance(x: Array, y: Array) -> Array:
        across, up = x - center[0], y - center[1]
        u, v = np.abs(cosine * across + sine * up) / a, np.abs(cosine * up - sine * across) / b
        radius: Array = (u**power + v**power) ** (1 / power)
        # Value over slope: a distance to first order at the outline.
        slope = np.hypot(u ** (power - 1) / a, v ** (power - 1) / b) / np.maximum(radius, 1e-6) ** (power - 1)
        value: Array = (radius - 1) / np.maximum(slope, 1e-6)
        return value

    return Shape(distance, center, float(np.hypot(a, b)) if power > 2 else max(a, b))


def capsule(
    start: tuple[float, float], end: tuple[float, float], radius: float, end_radius: float | None = None
) -> Shape:
    """Return all within a radius of a segment; the radius may change along it."""
    (x0, y0), (dx, dy) = start, (end[0] - start[0], end[1] - start[1])
    square = max(dx * dx + dy * dy, 1e-9)
    change = 0.0 if end_radius is None else end_radius - radius

    def distance(x: Array, y: Array) -> Array:
        along = np.clip(((x - x0) * dx + (y - y0) * dy) / square, 0.0, 1.0)
        away: Array = np.hypot(x - x0 - along * dx, y - y0 - along * dy)
        return away - radius - along * change

    middle = (x0 + dx / 2, y0 + dy / 2)
    return Shape(distance, middle, float(np.sqrt(square)) / 2 + max(radius, radius + change))
