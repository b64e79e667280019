"""A focal spot, a detector and the views they take."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]


def evenly_spaced_views(views: int, *, start: float = 0.0, span: float = 2 * math.pi) -> tuple[float, ...]:
    """Return `views` angles, rad, that divide `span` from `start` on; the end of the span is not one of them.

    Example:
        >>> [round(math.degrees(angle)) for angle in evenly_spaced_views(4)]
        [0, 90, 180, 270]
    """
    if views < 1:
        raise ValueError(f"A scan needs at least one view, got {views}.")
    return tuple(start + span * view / views for view in range(views))


@dataclass(frozen=True)
class FanBeam:
    """Fan beam on an arc centred on the focal spot (equi-angular), or on a flat detector.

    At view angle β the nominal focal spot is at (−R sin β, R cos β), R the distance to the isocentre: at the top
    for β = 0, counter-clockwise with growing β. The ray at fan angle γ runs along (sin(β+γ), −cos(β+γ)); γ grows
    with the bin number. With bins numbered j, c = (bins − 1)/2 and D the distance to the detector,

        arc    γ_j = (j − c) · 2 atan(bin_width / 2D) + atan(detector_offset · bin_width / D)
        flat   γ_j = atan((j − c + detector_offset) · bin_width / D)

    Args:
        view_angles: β of each view, rad, in any order; repeated and missing angles are allowed.
        bins: Number of detector cells in the fan.
        source_to_isocenter: Distance R from the nominal focal spot to the axis of rotation, mm.
        source_to_detector: Distance D from the nominal focal spot to the detector, mm.
        bin_width: Width of a cell at the detector, mm.
        detector_offset: Shift of the cells towards +γ in bins; 0.25 is the quarter-detector offset.
        detector: "arc" or "flat".
        focal_spot_shifts: For each view the shift of the focal spot (towards +γ, away from the isocentre), mm;
            the cells stay. Empty if the focal spot does not move.

    Raises:
        ValueError: If a number is not finite or not positive, the detector is not beyond the isocentre, or the
            fan opens to half a turn.

    References:
        The conventions are those of CatSim's default scanner.
    """

    view_angles: Sequence[float] | NDArray[np.float64]
    bins: int
    source_to_isocenter: float
    source_to_detector: float
    bin_width: float
    detector_offset: float = 0.0
    detector: Literal["arc", "flat"] = "arc"
    focal_spot_shifts: Sequence[tuple[float, float]] = ()

    def __post_init__(self) -> None:
        # Tuples of floats: frozen, hashable and equal by value, whatever sequence came in.
        object.__setattr__(self, "view_angles", tuple(float(angle) for angle in self.view_angles))
        shifts = tuple((float(along), float(away)) for along, away in self.focal_spot_shifts)
        object.__setattr__(self, "focal_spot_shifts", shifts)
        if not len(self.view_angles) or not all(map(math.isfinite, self.view_angles)):
            raise ValueError("A scan needs at least one view, and finite view angles in rad.")
        if self.bins < 1:
            raise ValueError(f"A detector needs at least one bin, got {self.bins}.")
        for name in ("source_to_isocenter", "source_to_detector", "bin_width"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise ValueError(f"{name} must be a positive length in mm, got {getattr(self, name)}.")
        if self.source_to_detector <= self.source_to_isocenter:
            raise ValueError(
                f"The detector must lie beyond the isocentre: source_to_detector is {self.source_to_detector} mm, "
                f"source_to_isocenter {self.source_to_isocenter} mm."
            )
        if not math.isfinite(self.detector_offset):
            raise ValueError(f"detector_offset must be a finite number of bins, got {self.detector_offset}.")
        if self.detector not in ("arc", "flat"):
            raise ValueError(f'The detector is "arc" or "flat", got "{self.detector}".')
        if shifts and len(shifts) != self.views:
            raise ValueError(f"Focal-spot shifts are one per view: {self.views} views, got {len(shifts)} shifts.")
        if not all(math.isfinite(length) for shift in shifts for length in shift):
            raise ValueError("Focal-spot shifts must be finite lengths in mm.")
        edges = self.fan_angle_edges
        if max(abs(edges[0]), abs(edges[-1])) >= math.pi / 2:
            raise ValueError(
                f"The fan must stay within 90 degrees of the central ray, got {math.degrees(edges[0]):.1f} to "
                f"{math.degrees(edges[-1]):.1f} degrees; are bin_width and source_to_detector both in mm?"
            )

    @property
    def views(self) -> int:
        """Number of views."""
        return len(self.view_angles)

    @property
    def shape(self) -> tuple[int, int]:
        """Views and bins."""
        return self.views, self.bins

    @property
    def fan_angles(self) -> NDArray[np.float64]:
        """γ at the centre of each bin, rad."""
        return self._fan_angles(np.arange(self.bins, dtype=np.float64))

    @property
    def fan_angle_edges(self) -> NDArray[np.float64]:
        """γ at the bins + 1 edges of the cells, rad."""
        return self._fan_angles(np.arange(self.bins + 1) - 0.5)

    def _fan_angles(self, number: NDArray[Any]) -> NDArray[np.float64]:
        along = number - (self.bins - 1) / 2
        if self.detector == "flat":
            return np.arctan((along + self.detector_offset) * self.bin_width / self.source_to_detector)
        pitch = 2 * math.atan(self.bin_width / 2 / self.source_to_detector)
        return along * pitch + math.atan(self.detector_offset * self.bin_width / self.source_to_detector)

    @property
    def bin_width_at_isocenter(self) -> float:
        """Width of a cell seen from the focal spot at the distance of the isocentre, mm."""
        return self.bin_width * self.source_to_isocenter / self.source_to_detector

    @property
    def field_of_view_radius(self) -> float:
        """Radius of the circle about the isocentre that the wider side of the fan reaches, mm."""
        widest = float(np.abs(self.fan_angle_edges[[0, -1]]).max())
        return self.source_to_isocenter * math.sin(widest)

    def focal_spots(self) -> Points:
        """Return where the focal spot is in each view: (views, 2), mm."""
        beta = np.asarray(self.view_angles)
        away = np.stack([-np.sin(beta), np.cos(beta)], axis=-1)
        spots = self.source_to_isocenter * away
        if self.focal_spot_shifts:
            shift = np.asarray(self.focal_spot_shifts)
            along = np.stack([np.cos(beta), np.sin(beta)], axis=-1)
            spots = spots + shift[:, :1] * along + shift[:, 1:] * away
        return spots

    def detector_points(self, fan_angles: NDArray[np.float64]) -> Points:
        """Return the points of the detector at the given fan angles: (views, angles, 2), mm."""
        beta = np.asarray(self.view_angles)[:, None]
        nominal = self.source_to_isocenter * np.stack([-np.sin(beta), np.cos(beta)], axis=-1)
        reach = self.source_to_detector / (np.cos(fan_angles) if self.detector == "flat" else np.ones_like(fan_angles))
        towards = beta + fan_angles
        points: Points = nominal + reach[:, None] * np.stack([np.sin(towards), -np.cos(towards)], axis=-1)
        return points
