"""Where the focal spot is in each view."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Views: TypeAlias = slice | Sequence[int] | NDArray[Any]
"""A subset of views: a slice, their numbers, or a mask with one boolean per view."""

_AT_REST = 1e-3
"""mm a turn; a slower table is at rest."""

MOST_VIEWS = 1_000_000
"""More views than any scan has: a helix of a whole patient has a hundred thousand."""


def evenly_spaced_views(views: int, *, start: float = 0.0, span: float = 2 * math.pi) -> tuple[float, ...]:
    """Return `views` angles, rad, that divide `span` from `start` on; the end of the span is not one of them.

    Raises:
        ValueError: If there are no views, or more than a million.

    Example:
        >>> [round(math.degrees(angle)) for angle in evenly_spaced_views(4)]
        [0, 90, 180, 270]
    """
    if views < 1:
        raise ValueError(f"A scan needs at least one view, got {views}.")
    if views > MOST_VIEWS:
        raise ValueError(f"A scan has at most {MOST_VIEWS} views, got {views}.")
    return tuple(start + span * view / views for view in range(views))


def view_numbers(chosen: Views, views: int) -> NDArray[np.int64]:
    """Return the numbers of the chosen views, counted from 0.

    Args:
        chosen: Which views; numbers may repeat and come in any order, and count from the end where negative.
        views: How many there are.

    Raises:
        IndexError: If a view is not there, the mask is not for so many views, or no view is chosen.
        TypeError: If it is none of these.

    Example:
        >>> view_numbers(slice(1, None, 2), 6).tolist(), view_numbers([-1, 0], 6).tolist()
        ([1, 3, 5], [5, 0])
    """
    numbers = np.arange(views)[chosen if isinstance(chosen, slice) else np.asarray(chosen)]
    if numbers.ndim != 1:
        raise TypeError("A subset of views is a slice, a list of numbers, or a mask with one boolean per view.")
    if not numbers.size:
        raise IndexError(f"A subset needs at least one of the {views} views, but none is chosen.")
    return numbers


@dataclass(frozen=True)
class Trajectory:
    """The path of the focal spot around and along the patient: a circle, a helix, or any set of views.

    `trajectory[...]` is the trajectory of a subset of the views.

    Args:
        angles: View angle β of each view, rad, in any order; a helix of several rotations goes beyond 2π.
        z: Height of each view, mm, growing towards the head: of the nominal focal spot and of the middle of the
            detector. Empty if all are at 0.
        focal_spot_shifts: For each view the shift of the focal spot (towards growing fan angle, away from the axis,
            towards growing z), mm; the detector stays. Empty if the focal spot does not move.

    Raises:
        ValueError: If there is no view, a number is not finite, or there is not one height or shift per view.

    Example:
        >>> helix = Trajectory(angles=(0.0, 0.1, 0.2, 0.3), z=(0.0, 0.5, 1.0, 1.5))
        >>> helix[::2]
        <Trajectory: 2 views from 0° to 11.46°, z = 0 to 1 mm, 31.42 mm a turn>
    """

    angles: Sequence[float] | NDArray[np.float64]
    z: Sequence[float] | NDArray[np.float64] = ()
    focal_spot_shifts: Sequence[tuple[float, float, float]] = ()

    def __post_init__(self) -> None:
        if len(self.angles) > MOST_VIEWS:
            raise ValueError(f"A scan has at most {MOST_VIEWS} views, got {len(self.angles)}.")
        # Tuples of floats: frozen, hashable and equal by value, whatever sequence came in.
        object.__setattr__(self, "angles", tuple(float(angle) for angle in self.angles))
        object.__setattr__(self, "z", tuple(float(height) for height in self.z))
        shifts = tuple((float(along), float(away), float(up)) for along, away, up in self.focal_spot_shifts)
        object.__setattr__(self, "focal_spot_shifts", shifts)
        if not len(self.angles) or not all(map(math.isfinite, self.angles)):
            raise ValueError("A scan needs at least one view, and finite view angles in rad.")
        if len(self.z) not in (0, self.views):
            raise ValueError(f"Heights are one per view: {self.views} views, got {len(self.z)} heights.")
        if not all(map(math.isfinite, self.z)):
            raise ValueError("The heights of views must be finite lengths in mm.")
        if len(shifts) not in (0, self.views):
            raise ValueError(f"Focal-spot shifts are one per view: {self.views} views, got {len(shifts)} shifts.")
        if not all(math.isfinite(length) for shift in shifts for length in shift):
            raise ValueError("Focal-spot shifts must be finite lengths in mm.")

    def __repr__(self) -> str:
        return f"<Trajectory: {self}>"

    def __str__(self) -> str:
        angles, heights = np.degrees(self.angles) + 0.0, self.heights  # no angle is −0
        steps = np.diff(angles)
        in_order = (steps >= 0).all() or (steps <= 0).all()
        first, last = angles[[0, -1]] if in_order else (angles.min(), angles.max())
        words = f"{self.views} views from {first:.4g}° to {last:.4g}°{'' if in_order else ' in any order'}"
        words += ", a moving focal spot" if self.focal_spot_shifts else ""
        if np.ptp(heights) > 0:
            words += f", z = {heights.min():.4g} to {heights.max():.4g} mm"
        elif heights[0]:
            words += f", z = {heights[0]:.4g} mm"
        return words + (f", {self.feed:.4g} mm a turn" if self.feed else "")

    def __getitem__(self, views: Views) -> "Trajectory":
        numbers = view_numbers(views, self.views).tolist()
        return Trajectory(
            [self.angles[number] for number in numbers],
            [self.z[number] for number in numbers] if len(self.z) else (),
            [self.focal_spot_shifts[number] for number in numbers] if self.focal_spot_shifts else (),
        )

    @property
    def views(self) -> int:
        """Number of views."""
        return len(self.angles)

    @property
    def heights(self) -> NDArray[np.float64]:
        """Height of each view, mm: `z`, or zeros."""
        return np.asarray(self.z, dtype=np.float64) if len(self.z) else np.zeros(self.views)

    @cached_property
    def feed(self) -> float:
        """How far the focal spot rises in a turn, mm, by a line fitted to all views; negative where it falls."""
        heights, angles = self.heights, np.asarray(self.angles)
        if not (np.ptp(heights) > 0 and np.ptp(angles) > 0):
            return 0.0
        feed = float(np.polyfit(angles - angles.mean(), heights, 1)[0]) * 2 * math.pi
        feed = feed if angles[-1] >= angles[0] else -feed
        return feed if abs(feed) > _AT_REST else 0.0

    @property
    def away(self) -> NDArray[np.float64]:
        """Direction from the axis to the nominal focal spot in each view: (views, 2)."""
        beta = np.asarray(self.angles)
        return np.stack([-np.sin(beta), np.cos(beta)], axis=-1)

    @property
    def along(self) -> NDArray[np.float64]:
        """Direction across the fan in each view, towards growing fan angle: (views, 2)."""
        beta = np.asarray(self.angles)
        return np.stack([np.cos(beta), np.sin(beta)], axis=-1)
