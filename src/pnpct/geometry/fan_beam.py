"""A focal spot, one row of detector cells, and the views they take of one plane."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pnpct.geometry.cone_beam import DEFAULT_SIZE, ConeBeam, Points
from pnpct.geometry.detector import Detector
from pnpct.geometry.image_grid import ImageGrid
from pnpct.geometry.trajectory import Trajectory, Views


@dataclass(frozen=True)
class FanBeam:
    """Fan beam on an arc centred on the focal spot (equi-angular), or on a flat detector: one plane, no z.

    At view angle β the nominal focal spot is at (−R sin β, R cos β), R the distance to the isocentre: at the top
    for β = 0, counter-clockwise with growing β. The ray at fan angle γ runs along (sin(β+γ), −cos(β+γ)); γ grows
    with the bin number, as `Detector` says. `geometry[...]` is the geometry of a subset of the views.

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
            fan opens to 180 degrees.

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
        _ = self.cone_beam  # which checks the numbers

    @classmethod
    def from_cone_beam(cls, geometry: ConeBeam) -> "FanBeam":
        """Return the rays of one row seen along the axis, the same for every row.

        Which row is measured, and how much its rays rise, is not in it: the rays of a row at the height v are
        longer by the factor √(1 + (v/D)²).

        Args:
            geometry: A cone beam with all views at one height.

        Raises:
            ValueError: If the focal spot changes its height.
        """
        spots = geometry.focal_spots()
        if np.ptp(spots[:, 2]) > 0:
            raise ValueError(
                f"A fan beam stays in one plane, but the focal spot moves from z = {spots[:, 2].min():g} to "
                f"{spots[:, 2].max():g} mm in these views."
            )
        trajectory, detector = geometry.trajectory, geometry.detector
        return cls(
            view_angles=trajectory.angles,
            bins=detector.bins,
            source_to_isocenter=geometry.source_to_isocenter,
            source_to_detector=geometry.source_to_detector,
            bin_width=detector.bin_width,
            detector_offset=detector.offset,
            detector=detector.kind,
            focal_spot_shifts=[(along, away) for along, away, _ in trajectory.focal_spot_shifts],
        )

    @cached_property
    def cone_beam(self) -> ConeBeam:
        """The same rays as a cone beam at height 0 with a single row, which has no thickness."""
        shifts = [(along, away, 0.0) for along, away in self.focal_spot_shifts]
        return ConeBeam(
            Trajectory(self.view_angles, focal_spot_shifts=shifts),
            Detector(self.bins, self.bin_width, self.detector_offset, self.detector),
            source_to_isocenter=self.source_to_isocenter,
            source_to_detector=self.source_to_detector,
        )

    def __getitem__(self, views: Views) -> "FanBeam":
        return FanBeam.from_cone_beam(self.cone_beam[views])

    def __repr__(self) -> str:
        return repr(self.cone_beam).replace("ConeBeam", "FanBeam", 1)

    def __str__(self) -> str:
        return str(self.cone_beam)

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
        return self.cone_beam.fan_angles

    @property
    def fan_angle_edges(self) -> NDArray[np.float64]:
        """γ at the bins + 1 edges of the cells, rad."""
        return self.cone_beam.fan_angle_edges

    @property
    def bin_width_at_isocenter(self) -> float:
        """Width of a cell seen from the focal spot at the distance of the isocentre, mm."""
        return self.cone_beam.bin_width_at_isocenter

    @property
    def field_of_view_radius(self) -> float:
        """Radius of the circle about the isocentre that the wider side of the fan reaches, mm."""
        return self.cone_beam.field_of_view_radius

    @property
    def limited_angle(self) -> bool:
        """Whether the views leave directions unmeasured."""
        return self.cone_beam.limited_angle

    def grid(self, size: int = DEFAULT_SIZE) -> ImageGrid:
        """Return square pixels over the field of view of the fan, as `ConeBeam.grid` does."""
        return self.cone_beam.grid(size)

    def widened(self, before: int, after: int) -> "FanBeam":
        """Return the same views with more bins at both ends of the fan.

        Args:
            before: Bins before the first one, at least 0.
            after: Bins after the last one, at least 0.
        """
        edges = self.fan_angle_edges
        if self.detector == "arc":
            middle = (edges[0] + edges[-1] + (after - before) * (edges[1] - edges[0])) / 2
            offset = math.tan(middle) * self.source_to_detector / self.bin_width
        else:
            offset = self.detector_offset + (after - before) / 2
        return replace(self, bins=self.bins + before + after, detector_offset=offset)

    def focal_spots(self) -> Points:
        """Return where the focal spot is in each view: (views, 2), mm."""
        return np.ascontiguousarray(self.cone_beam.focal_spots()[..., :2])

    def detector_points(self, fan_angles: NDArray[np.float64]) -> Points:
        """Return the points of the detector at the given fan angles: (views, angles, 2), mm."""
        return np.ascontiguousarray(self.cone_beam.detector_points(fan_angles)[..., :2])


Geometry: TypeAlias = FanBeam | ConeBeam
"""Where the rays of a scan are; `shape` is that of its arrays without a batch."""


def require_fan_beam(geometry: Geometry) -> FanBeam:
    """Return the geometry, if it is a fan beam: for what works on one plane only.

    Raises:
        ValueError: If it is a cone beam.
    """
    if isinstance(geometry, FanBeam):
        return geometry
    low, high = np.sort(geometry.trajectory.heights)[[0, -1]]
    heights = f"z = {low:g} mm" if low == high else f"z = {low:g} to {high:g} mm"
    raise ValueError(
        f"A fan beam is needed, with one detector row in one plane, but this scan is a cone beam of {geometry.rows} "
        f"detector rows at {heights}; give a scan of one plane."
    )
