"""What the views of a cone beam cover."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pnpct.geometry.cone_beam import ConeBeam

_SAME_SPOT = 0.05
"""mm; focal spots nearer to each other are one: those that fly do so by a tenth of a millimetre and more."""

_ROUNDING = 1e-4
"""Turns; angles are stored in single precision."""


@dataclass(frozen=True)
class Coverage:
    """What the views of a cone beam cover: turns, heights, pitch and the slices that can be reconstructed.

    Args:
        geometry: The views.

    Example:
        >>> from pnpct.geometry import Detector, Trajectory
        >>> angles = np.arange(-300, 301) * math.pi / 50
        >>> trajectory = Trajectory(angles, z=20.0 * angles / (2 * math.pi))
        >>> helix = ConeBeam(trajectory, Detector(9, 100.0, rows=32, row_height=1.096), 541.0, 949.0)
        >>> cover = Coverage(helix)
        >>> round(cover.turns, 2), round(cover.feed, 6), round(cover.pitch, 2), cover.focal_spot_mode
        (6.01, 20.0, 1.0, 'FFSNONE')
    """

    geometry: ConeBeam

    @cached_property
    def _angles(self) -> NDArray[np.float64]:
        return np.asarray(self.geometry.trajectory.angles)

    @property
    def turns(self) -> float:
        """Rotations, of which each view is a part."""
        views = self.geometry.views
        return float(np.ptp(self._angles)) / (2 * math.pi) * views / max(1, views - 1)

    @property
    def feed(self) -> float:
        """How far the focal spot rises in a turn, mm; negative where it falls."""
        return self.geometry.trajectory.feed

    @property
    def collimation(self) -> float:
        """Height of all rows together at the isocentre, mm."""
        return self.geometry.rows * self.geometry.row_height_at_isocenter

    @property
    def pitch(self) -> float:
        """Feed over collimation; 0 of an axial scan, and where rows have no height."""
        return abs(self.feed) / self.collimation if self.collimation else 0.0

    @property
    def heights(self) -> tuple[float, float]:
        """Lowest and highest position of the nominal focal spot, mm."""
        heights = self.geometry.trajectory.heights
        return float(heights.min()), float(heights.max())

    @property
    def slices(self) -> tuple[float, float] | None:
        """Lowest and highest slice with all its views, mm; None if there is none.

        Of a helix these are slices around which the focal spot makes half a turn and a fan; of an axial scan with as
        many views those that the rows see on the axis: away from it the cone sees less, in proportion to the distance
        from the focal spot.
        """
        low, high = self.heights
        short_scan = self.geometry.short_scan / (2 * math.pi)
        if not self.feed:
            if self.turns < min(1.0, short_scan) - _ROUNDING:
                return None
            scale = self.geometry.source_to_isocenter / self.geometry.source_to_detector
            edges = self.geometry.detector.row_edges * scale
            return high + float(edges[0]), low + float(edges[-1])
        needed = abs(self.feed) * short_scan / 2
        return (low + needed, high - needed) if low + needed <= high - needed else None

    @property
    def focal_spot_mode(self) -> str:
        """How the focal spot flies, as DICOM-CT-PD names it: FFSNONE, FFSZ, FFSXY or FFSXYZ."""
        shifts = np.asarray(self.geometry.trajectory.focal_spot_shifts).reshape(-1, 3)
        across, _, along = np.ptp(shifts, axis=0) > _SAME_SPOT if len(shifts) else (False, False, False)
        return "FFS" + (("XY" if across else "") + ("Z" if along else "") or "NONE")

    @property
    def words(self) -> dict[str, str]:
        """What the views cover, in words by name."""
        detector = self.geometry.detector
        (low, high), slices = self.heights, self.slices
        words = {
            "turns": f"{self.turns:.2f}, {self.geometry.views / self.turns:.0f} views a turn" if self.turns else "none",
            "rows": f"{detector.rows} of {self.geometry.row_height_at_isocenter:.4g} mm at the isocentre",
            "focal spot": f"{self.focal_spot_mode}, "
            + (f"z = {low:.2f} to {high:.2f} mm" if self.feed else f"z = {low:.2f} mm"),
            "slices": "none has all its views" if slices is None else f"z = {slices[0]:.2f} to {slices[1]:.2f} mm",
        }
        if self.feed:
            return {"path": f"helix, feed {self.feed:.3f} mm a turn, pitch {self.pitch:.3f}", **words}
        words["slices"] += " on the axis; fewer away from it, for the cone" if slices else ""
        return {"path": "axial", **words}
