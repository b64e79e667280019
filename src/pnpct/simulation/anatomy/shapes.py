"""Solids as signed distances, from which anatomy is painted slice by slice."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.floating]
Point: TypeAlias = tuple[float, float, float]
Distance: TypeAlias = Callable[[Array, Array, float], Array]


@dataclass(frozen=True)
class Shape:
    """A solid by its signed distance: negative inside, positive outside, mm.

    Args:
        distance: From positions x and y in the slice at height z, mm, to the signed distance, mm; right near
            the surface, at least in its sign elsewhere.
        low: Lowest x, y and z of a box that holds the solid, mm.
        high: Highest x, y and z of that box, mm.
    """

    distance: Distance
    low: Point
    high: Point

    def at(self, point: Point) -> float:
        """Return the signed distance of one point."""
        return float(self.distance(np.array([point[0]]), np.array([point[1]]), point[2])[0])

    def grown(self, by: float) -> "Shape":
        """Move the surface outwards by a distance in mm; inwards if negative."""
        return Shape(
            lambda x, y, z: self.distance(x, y, z) - by,
            _point(low - by for low in self.low),
            _point(high + by for high in self.high),
        )

    def within(self, other: "Shape") -> "Shape":
        """Return what is in both solids."""
        return Shape(
            lambda x, y, z: np.maximum(self.distance(x, y, z), other.distance(x, y, z)),
            _point(map(max, self.low, other.low)),
            _point(map(min, self.high, other.high)),
        )

    def without(self, other: "Shape") -> "Shape":
        """Return what is in this solid but not in the other."""
        return Shape(lambda x, y, z: np.maximum(self.distance(x, y, z), -other.distance(x, y, z)), self.low, self.high)

    def between(self, lowest: float, highest: float) -> "Shape":
        """Return what lies between two heights, mm."""
        return Shape(
            lambda x, y, z: np.maximum(self.distance(x, y, z), max(lowest - z, z - highest)),
            (*self.low[:2], max(self.low[2], lowest)),
            (*self.high[:2], min(self.high[2], highest)),
        )


def union(*shapes: Shape, smoothing: float = 0.0) -> Shape:
    """Return the union of solids; concave edges are rounded over about `smoothing` mm."""

    def distance(x: Array, y: Array, z: float) -> Array:
        together = shapes[0].distance(x, y, z)
        for shape in shapes[1:]:
            other = shape.distance(x, y, z)
            overlap = np.maximum(smoothing - np.abs(together - other), 0.0) / max(smoothing, 1e-6)
            together = np.minimum(together, other) - overlap**2 * (smoothing / 4)
        return together

    return Shape(
        distance,
        _point(min(lows) - smoothing for lows in zip(*(shape.low for shape in shapes), strict=True)),
        _point(max(highs) + smoothing for highs in zip(*(shape.high for shape in shapes), strict=True)),
    )


def ellipsoid(center: Point, half_axes: Point, *, angle: float = 0.0, power: float = 2.0) -> Shape:
    """Return an ellipsoid, |x/a|^power + |y/b|^power + |z/c|^power < 1 in axes turned about z by `angle`, rad.

    Above a power of 2 it is boxy.
    """
    (a, b, c), cosine, sine = half_axes, math.cos(angle), math.sin(angle)

    def distance(x: Array, y: Array, z: float) -> Array:
        across, up = x - center[0], y - center[1]
        u, v = np.abs(cosine * across + sine * up) / a, np.abs(cosine * up - sine * across) / b
        return _superquadric(u, v, abs(z - center[2]) / c, (a, b, c), power)

    reach = math.hypot(a, b) if power > 2 else max(a, b)
    return Shape(
        distance,
        (center[0] - reach, center[1] - reach, center[2] - c),
        (center[0] + reach, center[1] + reach, center[2] + c),
    )


def _superquadric(u: Array, v: Array, w: float, half_axes: Point, power: float) -> Array:
    a, b, c = half_axes
    if power == 2:  # the same without powers, several times faster
        radius: Array = np.sqrt(u * u + v * v + w * w)
        steepness = np.sqrt((u / a) ** 2 + (v / b) ** 2 + (w / c) ** 2)
        return (radius - 1) * radius / np.maximum(steepness, 1e-6)
    radius = (u**power + v**power + w**power) ** (1 / power)
    # Value over slope: a distance to first order at the surface.
    slopes = (u ** (power - 1) / a) ** 2 + (v ** (power - 1) / b) ** 2 + (w ** (power - 1) / c) ** 2
    slope = np.sqrt(slopes) / np.maximum(radius, 1e-6) ** (power - 1)
    value: Array = (radius - 1) / np.maximum(slope, 1e-6)
    return value


def loft(stations: Sequence[tuple[float, float, float, float, float]], *, power: float = 2.0) -> Shape:
    """Return a solid with elliptical slices, smooth from station to station.

    Args:
        stations: Rows of z, x and y of the middle, and the half axes along x and y, mm, by growing z. The
            solid ends flat at the first and the last.
        power: Above 2 the ellipses are boxy, as in `ellipsoid`.
    """
    table = np.array(stations, dtype=np.float64)
    heights, ellipses = table[:, 0], table[:, 1:]
    slopes = np.gradient(ellipses, heights, axis=0) if len(heights) > 2 else np.zeros_like(ellipses)
    xs, ys, a, b = ellipses.T

    def distance(x: Array, y: Array, z: float) -> Array:
        middle_x, middle_y, half_x, half_y = _smooth_interpolation(z, heights, ellipses, slopes)
        u, v = np.abs(x - middle_x) / half_x, np.abs(y - middle_y) / half_y
        inside = _superquadric(u, v, 0.0, (half_x, half_y, 1.0), power)
        clipped: Array = np.maximum(inside, max(heights[0] - z, z - heights[-1]))
        return clipped

    return Shape(
        distance,
        (float((xs - a).min()), float((ys - b).min()), float(heights[0])),
        (float((xs + a).max()), float((ys + b).max()), float(heights[-1])),
    )


def _smooth_interpolation(z: float, heights: Array, values: Array, slopes: Array) -> list[float]:
    """Cubic between stations with these slopes, flat beyond the ends."""
    place = int(np.clip(np.searchsorted(heights, z) - 1, 0, len(heights) - 2))
    step = heights[place + 1] - heights[place]
    t = float(np.clip((z - heights[place]) / step, 0.0, 1.0))
    before, after = slopes[place] * step, slopes[place + 1] * step
    start, rise = values[place], values[place + 1] - values[place]
    smooth = start + t * before + t**2 * (3 * rise - 2 * before - after) + t**3 * (before + after - 2 * rise)
    interpolated: list[float] = smooth.tolist()
    return interpolated


def capsule(start: Point, end: Point, radius: float, end_radius: float | None = None) -> Shape:
    """Return all within a radius of a segment; the radius may change along it."""
    (x0, y0, z0), (dx, dy, dz) = start, (end[0] - start[0], end[1] - start[1], end[2] - start[2])
    square = max(dx * dx + dy * dy + dz * dz, 1e-9)
    last = radius if end_radius is None else end_radius

    def distance(x: Array, y: Array, z: float) -> Array:
        along = np.clip(((x - x0) * dx + (y - y0) * dy + (z - z0) * dz) / square, 0.0, 1.0)
        away: Array = np.sqrt((x - x0 - along * dx) ** 2 + (y - y0 - along * dy) ** 2 + (z - z0 - along * dz) ** 2)
        return away - radius - along * (last - radius)

    return Shape(
        distance,
        _point(min(one - radius, other - last) for one, other in zip(start, end, strict=True)),
        _point(max(one + radius, other + last) for one, other in zip(start, end, strict=True)),
    )


def tube(points: Sequence[Point], radii: float | Sequence[float], *, smoothing: float = 0.0) -> Shape:
    """Return all within a radius of a line through points; with one radius per point it changes along it."""
    each = [radii] * len(points) if isinstance(radii, (int, float)) else list(radii)
    pieces = zip(points[:-1], points[1:], each[:-1], each[1:], strict=True)
    return union(*(capsule(*piece) for piece in pieces), smoothing=smoothing)


def _point(values: Iterable[float]) -> Point:
    x, y, z = values
    return (x, y, z)
