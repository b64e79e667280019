"""A focal spot, a detector of several rows, and the views they take."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pnpct.geometry.detector import Detector
from pnpct.geometry.image_grid import ImageGrid
from pnpct.geometry.trajectory import Trajectory, Views

Points = NDArray[np.float64]

DEFAULT_SIZE = 512
"""Rows and columns of an image whose size was not given."""

LIMITED = math.radians(12.0)
"""Views leave directions unmeasured if neighbouring ones, opposite views taken for the same, are farther apart."""


@dataclass(frozen=True)
class ConeBeam:
    """A cone beam: all rows of the detector face the focal spot, which rotates about the z axis.

    At view angle β and height z the nominal focal spot is at (−R sin β, R cos β, z), R the distance to the axis: at
    the top for β = 0, counter-clockwise with growing β. The ray to the bin at fan angle γ runs, seen along the axis,
    along (sin(β+γ), −cos(β+γ)); γ grows with the bin number, the height of the cells with the row number.
    `geometry[...]` is the geometry of a subset of the views.

    Args:
        trajectory: The views.
        detector: The cells.
        source_to_isocenter: Distance R from the nominal focal spot to the axis of rotation, mm.
        source_to_detector: Distance D from the nominal focal spot to the detector, mm.

    Raises:
        ValueError: If a distance is not positive, the detector is not beyond the axis, or the fan opens to 180
            degrees.

    References:
        The conventions are those of CatSim's default scanner.

    Example:
        >>> detector = Detector(bins=900, bin_width=1.0239, rows=32, row_height=1.0964)
        >>> helix = ConeBeam(Trajectory((0.0, 0.1, 0.2), z=(0.0, 0.3, 0.6)), detector, 541.0, 949.0)
        >>> helix.shape, helix[1:].shape
        ((3, 32, 900), (2, 32, 900))
        >>> helix.focal_spots()[0].tolist()
        [-0.0, 541.0, 0.0]
    """

    trajectory: Trajectory
    detector: Detector
    source_to_isocenter: float
    source_to_detector: float

    def __post_init__(self) -> None:
        for name in ("source_to_isocenter", "source_to_detector"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise ValueError(f"{name} must be a positive length in mm, got {getattr(self, name)}.")
        if self.source_to_detector <= self.source_to_isocenter:
            raise ValueError(
                f"The detector must lie beyond the isocentre: source_to_detector is {self.source_to_detector} mm, "
                f"source_to_isocenter {self.source_to_isocenter} mm; give both from the focal spot."
            )
        edges = self.fan_angle_edges
        if max(abs(edges[0]), abs(edges[-1])) >= math.pi / 2:
            raise ValueError(
                f"The fan must stay within 90 degrees of the central ray, got {math.degrees(edges[0]):.1f} to "
                f"{math.degrees(edges[-1]):.1f} degrees; are bin_width and source_to_detector both in mm?"
            )

    def __getitem__(self, views: Views) -> "ConeBeam":
        return replace(self, trajectory=self.trajectory[views])

    def __repr__(self) -> str:
        detector, collimation = self.detector, self.rows * self.row_height_at_isocenter
        pitch = abs(self.trajectory.feed) / collimation if collimation else 0.0
        cells = f"{detector.bin_width:.4g}" + (f" x {detector.row_height:.4g}" if detector.row_height else "")
        return (
            f"<ConeBeam: {self.trajectory}{f' (pitch {pitch:.3g})' if pitch else ''}; {detector}, cells of {cells} mm"
            f"{f', offset {detector.offset:.4g}' if detector.offset else ''}; focal spot to axis "
            f"{self.source_to_isocenter:.4g} mm, to detector {self.source_to_detector:.4g} mm; sees "
            f"{self.field_of_view_radius:.4g} mm around the axis>"
        )

    def __str__(self) -> str:
        return f"{self.views} views of {self.detector}"

    @property
    def views(self) -> int:
        """Number of views."""
        return self.trajectory.views

    @property
    def rows(self) -> int:
        """Number of detector rows."""
        return self.detector.rows

    @property
    def bins(self) -> int:
        """Number of detector cells in a row."""
        return self.detector.bins

    @property
    def shape(self) -> tuple[int, int, int]:
        """Views, rows and bins."""
        return self.views, self.rows, self.bins

    @property
    def fan_angles(self) -> NDArray[np.float64]:
        """γ at the centre of each bin, rad."""
        return self.detector.fan_angles(self.source_to_detector)

    @property
    def fan_angle_edges(self) -> NDArray[np.float64]:
        """γ at the bins + 1 edges of the cells, rad."""
        return self.detector.fan_angle_edges(self.source_to_detector)

    @property
    def bin_width_at_isocenter(self) -> float:
        """Width of a cell seen from the focal spot at the distance of the isocentre, mm."""
        return self.detector.bin_width * self.source_to_isocenter / self.source_to_detector

    @property
    def row_height_at_isocenter(self) -> float:
        """Height of a row seen from the focal spot at the distance of the isocentre, mm."""
        return self.detector.row_height * self.source_to_isocenter / self.source_to_detector

    @property
    def short_scan(self) -> float:
        """Angle over which a slice needs views, rad: half a turn and the fan, whose wider side counts twice."""
        return math.pi + 2 * self._widest_fan_angle

    @property
    def field_of_view_radius(self) -> float:
        """Radius of the circle about the axis that the wider side of the fan reaches, mm."""
        return self.source_to_isocenter * math.sin(self._widest_fan_angle)

    @property
    def limited_angle(self) -> bool:
        """Whether the views leave directions unmeasured."""
        directions = np.sort(np.mod(self.trajectory.angles, math.pi))
        return bool(np.diff(directions, append=directions[0] + math.pi).max() > LIMITED)

    @property
    def _widest_fan_angle(self) -> float:
        return float(np.abs(self.fan_angle_edges[[0, -1]]).max())

    def grid(self, size: int = DEFAULT_SIZE) -> ImageGrid:
        """Return square pixels over the field of view of the fan.

        Args:
            size: Rows and columns, at least 1.

        Raises:
            ValueError: If there is no row.
        """
        return ImageGrid(size, size, spacing=2 * self.field_of_view_radius / max(size, 1))

    def focal_spots(self) -> Points:
        """Return where the focal spot is in each view: (views, 3), mm."""
        trajectory = self.trajectory
        plane, heights = self.source_to_isocenter * trajectory.away, trajectory.heights
        if trajectory.focal_spot_shifts:
            shift = np.asarray(trajectory.focal_spot_shifts)
            plane = plane + shift[:, :1] * trajectory.along + shift[:, 1:2] * trajectory.away
            heights = heights + shift[:, 2]
        return np.concatenate([plane, heights[:, None]], axis=-1)

    def detector_points(self, fan_angles: NDArray[np.float64]) -> Points:
        """Return the points of the detector at the given fan angles and the height of the views, mm.

        Args:
            fan_angles: γ, rad.

        Returns:
            (views, angles, 3); the rows are `detector.row_positions` above these points.
        """
        beta = np.asarray(self.trajectory.angles)[:, None]
        nominal = self.source_to_isocenter * self.trajectory.away[:, None]
        flat = self.detector.kind == "flat"
        reach = self.source_to_detector / (np.cos(fan_angles) if flat else np.ones_like(fan_angles))
        towards = beta + fan_angles
        plane = nominal + reach[:, None] * np.stack([np.sin(towards), -np.cos(towards)], axis=-1)
        heights = np.broadcast_to(self.trajectory.heights[:, None, None], (*towards.shape, 1))
        return np.concatenate([plane, heights], axis=-1)
