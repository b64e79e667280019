"""Planes in which a helix, or a circle, nearly lies for the views that a slice needs.

Of a helix there is one plane for each central angle b, through the focal spot at b and at b ± 60°,

    h(x, y) = z + slope · (x, y),     slope = −feed a/(2π R sin a) (cos b, sin b),     a = 60°,

which takes the views of b ± (90° + half the fan). A circle has the horizontal planes near its own.

The views are those of a window, one of 16 in a turn, that belongs to all planes with a central angle in it: such planes
have one fan beam between them, and windows a turn apart have the same. Angles are counted in steps of 12 µrad for that.

References:
    Kachelriess, Schaller and Kalender, Med. Phys. 27 (2000) 754: advanced single-slice rebinning.
    Noo, Defrise and Clackdoyle, Phys. Med. Biol. 44 (1999) 561: single-slice rebinning, the control.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pnpct.geometry.cone_beam import ConeBeam
from pnpct.geometry.coverage import Coverage
from pnpct.geometry.fan_beam import FanBeam
from pnpct.geometry.plane_stack import Array, Plane, PlaneStack, spanning

Rebinning: TypeAlias = Literal["tilted", "single-slice"]
"""Planes tilted with the helix, or horizontal ones with the rays of a full turn."""

WINDOWS = 16
"""Windows of a turn."""

_STEPS = 1 << 19
"""Steps of a turn; a quarter of it is a whole number of them."""

_WINDOW = _STEPS // WINDOWS

_TOGETHER = 4
"""Most planes of a circle in one stack."""

_MEETS = math.radians(60.0)
"""The plane meets the helix so far to either side of its central angle."""

_GAP = math.radians(5.0)
"""Views of a helix are missing between two that are farther apart than this and than three usual steps."""

_IN_MICROMETRES = 3
"""Shifts of the focal spot are rounded to as many decimals of a millimetre, so that views a turn apart agree."""


@dataclass(frozen=True, eq=False)
class TiltedPlanes:
    """The planes that the helix, or the circle, of a cone beam allows, and their views.

    Args:
        geometry: The cone beam.
        rebinning: "tilted", or "single-slice" for horizontal planes with a full turn of views, which a helix leaves
            farther: the control.

    Raises:
        ValueError: If the heights of the views do not grow evenly with their angles, or the rebinning is another.

    Example:
        >>> from pnpct.geometry import Detector, Trajectory
        >>> angles = 2 * math.pi / 100 * np.arange(300)
        >>> detector = Detector(bins=90, bin_width=10.0, rows=32, row_height=1.1)
        >>> helix = ConeBeam(Trajectory(angles, z=20 * angles / 2 / math.pi), detector, 541.0, 949.0)
        >>> planes = TiltedPlanes(helix)
        >>> views = planes.views(planes.stack_at(30.0))
        >>> len(views), planes.fan(views).shape
        (65, (65, 90))
    """

    geometry: ConeBeam
    rebinning: Rebinning = "tilted"

    def __post_init__(self) -> None:
        if self.rebinning not in ("tilted", "single-slice"):
            raise ValueError(f'The rebinning is "tilted" or "single-slice", got "{self.rebinning}".')
        gain, start = self._fit
        departs = float(np.abs(self._heights - (start + gain * self._angles)).max())
        if departs > max(self.geometry.row_height_at_isocenter, 1e-6):
            raise ValueError(
                "Planes are found for a circle, or for a helix whose heights grow evenly with its angles, which go on "
                f"beyond a turn; these views depart from that by {departs:.3g} mm: take those of one circle or helix."
            )

    @property
    def feed(self) -> float:
        """Height gained in a turn of growing angle, mm; 0 for a circle."""
        return 2 * math.pi * self._fit[0]

    @property
    def tilt(self) -> float:
        """Slope of the planes at its steepest."""
        if self.rebinning == "single-slice":
            return 0.0
        return -self.feed * _MEETS / (2 * math.pi * self.geometry.source_to_isocenter * math.sin(_MEETS))

    @property
    def reach(self) -> tuple[float, float]:
        """Lowest and highest height on the axis of planes whose views, or rows, were all measured, mm.

        Raises:
            ValueError: If there are none.
        """
        if self.feed == 0:
            if (cover := Coverage(self.geometry)).slices is None:
                raise ValueError(
                    f"A slice needs the views of {self.geometry.short_scan / (2 * math.pi):.2f} turns, but this axial "
                    f"scan has {cover.turns:.2f} turns; give a longer scan."
                )
            rows = self.geometry.detector.row_positions * self.geometry.row_height_at_isocenter
            low, high = self._heights[0] + rows[[0, -1]] / max(self.geometry.detector.row_height, 1e-6)
            return float(low), float(high)
        first, last = self._windows
        low, high = sorted(self._height(2 * math.pi / WINDOWS * edge) for edge in (first - 0.5, last + 0.5))
        return low, high

    def leaves(self, z: float, radius: float) -> float:
        """Return how far the rays of a circle leave the plane of a height, within a radius about the axis, mm."""
        return abs(z - self._fit[1]) * radius / self.geometry.source_to_isocenter

    def stack_at(self, z: float) -> PlaneStack:
        """Return the one plane of a height on the axis, with the views that are centred about it.

        Args:
            z: mm.
        """
        if self.feed == 0:
            return PlaneStack(0, (Plane(z),))
        central = (z - self._fit[1]) / self._fit[0]
        return PlaneStack(round(central / (2 * math.pi) * _STEPS), (self._plane(central),))

    def stacks(self, low: float, high: float, *, spacing: float) -> list[PlaneStack]:
        """Return planes from one height on the axis to another, from the lowest up, or as far as there are views.

        Those of a helix lie at heights of its own, so that they do not depend on what is asked for.

        Args:
            low: A height that is not below the lowest plane, mm. Of a circle this is the lowest plane.
            high: A height that is not above the highest plane, mm.
            spacing: Largest distance between neighbouring planes on the axis, mm, > 0; of a circle just so.

        Raises:
            ValueError: If the helix is too short for any, or views that they need are missing.
        """
        if self.feed == 0:
            heights = low + spacing * np.arange(math.ceil((high - low) / spacing - 1e-6) + 1)
            pieces = np.array_split(heights, math.ceil(len(heights) / _TOGETHER))
            return [PlaneStack(0, tuple(Plane(float(z)) for z in piece)) for piece in pieces]
        planes = math.ceil(abs(self.feed) / WINDOWS / spacing - 1e-6)
        places = np.sign(self.feed) * ((np.arange(planes) + 0.5) / planes - 0.5)
        first, last = self._windows
        windows = range(first, last + 1) if self.feed > 0 else range(last, first - 1, -1)
        stacks = [
            PlaneStack(
                window * _WINDOW,
                tuple(self._plane(2 * math.pi / WINDOWS * (window + place)) for place in places.tolist()),
            )
            for window in windows
        ]
        chosen = spanning(stacks, low, high)
        self._check_no_gap(min(stack.center for stack in chosen), max(stack.center for stack in chosen))
        return chosen

    def views(self, stack: PlaneStack) -> NDArray[np.int64]:
        """Return the numbers of the views of a stack, in the order of their angles.

        Raises:
            ValueError: If some of them were not measured.
        """
        if self.feed == 0:
            return self._order
        first, last = self._ends
        if not (first <= stack.center - self._half and stack.center + self._half <= last):
            low, high = self.reach
            raise ValueError(
                f"A slice at z = {stack.planes[0].z:g} mm needs views that were not measured; those that were have "
                f"slices from about {low:.4g} to {high:.4g} mm."
            )
        after = self._counted[self._order] - stack.center + self._half
        within: NDArray[np.int64] = self._order[(after >= 0) & (after < 2 * self._half)]
        return within

    def fan(self, views: NDArray[np.int64]) -> FanBeam:
        """Return the fan beam of these views, seen along the axis; a turn later it is the same."""
        geometry = self.geometry[views]
        shifts = [
            (round(along, _IN_MICROMETRES) + 0.0, round(away, _IN_MICROMETRES) + 0.0)
            for along, away, _ in geometry.trajectory.focal_spot_shifts
        ]
        angles = np.mod(self._counted[views], _STEPS) * (2 * math.pi / _STEPS)
        level = replace(geometry.trajectory, angles=angles, z=(), focal_spot_shifts=())
        fan = FanBeam.from_cone_beam(replace(geometry, trajectory=level))
        moving = any(along or away for along, away in shifts)
        return replace(fan, focal_spot_shifts=shifts) if moving else fan

    @property
    def most_blocks(self) -> int:
        """Most sixteenths of a turn in which the views of a stack are."""
        if self.feed == 0:
            return len(np.unique(self.blocks(self._order)))
        return math.ceil(2 * self._half / _WINDOW) + 1

    def blocks(self, views: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return for each view the number of its sixteenth of a turn; numbers go on from turn to turn."""
        numbers: NDArray[np.int64] = self._counted[views] // _WINDOW
        return numbers

    def views_of(self, block: int) -> NDArray[np.int64]:
        """Return the numbers of the views of a sixteenth of a turn, in the order of their angles."""
        views: NDArray[np.int64] = self._order[self.blocks(self._order) == block]
        return views

    @cached_property
    def _order(self) -> NDArray[np.int64]:
        order: NDArray[np.int64] = np.argsort(self._counted, kind="stable")
        return order

    @cached_property
    def _angles(self) -> Array:
        return np.asarray(self.geometry.trajectory.angles)

    @cached_property
    def _heights(self) -> Array:
        return self.geometry.trajectory.heights

    @cached_property
    def _counted(self) -> NDArray[np.int64]:
        counted: NDArray[np.int64] = np.rint(self._angles / (2 * math.pi) * _STEPS).astype(np.int64)
        return counted

    @cached_property
    def _fit(self) -> tuple[float, float]:
        """Height gained per rad, and height at the angle 0, mm."""
        if np.ptp(self._heights) < 1e-6 or np.ptp(self._angles) == 0:
            return 0.0, float(self._heights[0])
        middle = self._angles.mean()
        away, up = self._angles - middle, self._heights - self._heights.mean()
        gain = float(away @ up / (away @ away))
        return gain, float(self._heights.mean() - gain * middle)

    def _check_no_gap(self, first: int, last: int) -> None:
        """Check that no views are missing among those of the windows with these middles."""
        counted = np.unique(self._counted)
        begin, end = np.searchsorted(counted, [first - self._half, last + self._half])
        steps = np.diff(counted[max(begin - 1, 0) : end + 1])
        widest = max(3 * float(np.median(np.diff(counted))), _GAP / (2 * math.pi) * _STEPS)
        if steps.size and steps.max() > widest:
            before = max(begin - 1, 0) + int(steps.argmax())
            edges = (self._height(2 * math.pi / _STEPS * float(angle)) for angle in counted[before : before + 2])
            low, high = sorted(edges)
            raise ValueError(
                f"These slices need the views of the helix between z = {low:.4g} and {high:.4g} mm, which are missing; "
                "give the whole scan, or ask for slices farther from there."
            )

    def _height(self, angle: float) -> float:
        """Height of the helix, mm."""
        return self._fit[1] + self._fit[0] * angle

    @cached_property
    def _half(self) -> int:
        """Steps from the middle of a window to its ends."""
        half = round(self.geometry.short_scan / (4 * math.pi) * _STEPS)
        return half if self.rebinning == "tilted" else _STEPS // 2

    @cached_property
    def _windows(self) -> tuple[int, int]:
        """Numbers of the first and the last window whose views were all measured."""
        first, last = self._ends
        low = math.ceil((first + self._half) / _WINDOW)
        high = math.floor((last - self._half) / _WINDOW)
        if low > high:
            turns = (last - first) / _STEPS
            raise ValueError(
                f"A slice needs the views of {2 * self._half / _STEPS:.2f} turns of a helix, but this one has "
                f"{turns:.2f} turns; give a longer scan."
            )
        return low, high

    @cached_property
    def _ends(self) -> tuple[float, float]:
        """Steps at which the first view begins and the last one ends: half a view beyond their middles."""
        counted = np.unique(self._counted)
        half = float(np.median(np.diff(counted))) / 2 if counted.size > 1 else 0.0
        return counted[0] - half - 1, counted[-1] + half + 1

    def _plane(self, central: float) -> Plane:
        slope = (self.tilt * math.cos(central), self.tilt * math.sin(central))
        return Plane(self._height(central), slope)
