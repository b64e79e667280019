"""The cells of a detector."""

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

MOST_CELLS = 1_000_000
"""More cells in a row, and more rows, than any detector has."""


@dataclass(frozen=True)
class Detector:
    """Rows of cells on an arc around the nominal focal spot (equi-angular), or in a plane.

    With bins numbered j, c = (bins − 1)/2 and D the distance from the nominal focal spot to the detector, the centre
    of a cell is at the fan angle

        arc    γ_j = (j − c) · 2 atan(bin_width / 2D) + atan(offset · bin_width / D)
        flat   γ_j = atan((j − c + offset) · bin_width / D)

    and, with rows numbered r from the lowest, at the height

        v_r = (r − (rows − 1)/2 + row_offset) · row_height

    above the nominal focal spot. The rows stand straight above one another: the arc is part of a cylinder.

    Args:
        bins: Number of cells in a row.
        bin_width: Width of a cell, mm.
        offset: Shift of the cells towards growing fan angle in bins; 0.25 is the quarter-detector offset.
        kind: "arc" or "flat".
        rows: Number of rows.
        row_height: Height of a row at the detector, mm; 0 is a fan without thickness, which a single row may be.
        row_offset: Shift of the rows towards growing z in rows.

    Raises:
        ValueError: If a number is not finite, a length is not positive, or the kind is another.

    Example:
        >>> Detector(bins=3, bin_width=1.0, rows=4, row_height=1.1).row_positions.round(2).tolist()
        [-1.65, -0.55, 0.55, 1.65]
    """

    bins: int
    bin_width: float
    offset: float = 0.0
    kind: Literal["arc", "flat"] = "arc"
    rows: int = 1
    row_height: float = 0.0
    row_offset: float = 0.0

    def __post_init__(self) -> None:
        if self.bins < 1:
            raise ValueError(f"A detector needs at least one bin, got {self.bins}.")
        if self.rows < 1:
            raise ValueError(f"A detector needs at least one row, got {self.rows}.")
        if max(self.bins, self.rows) > MOST_CELLS:
            raise ValueError(f"A detector has at most {MOST_CELLS} bins and rows, got {self.bins} and {self.rows}.")
        if not (math.isfinite(self.bin_width) and self.bin_width > 0):
            raise ValueError(f"bin_width must be a positive length in mm, got {self.bin_width}.")
        if not (math.isfinite(self.row_height) and self.row_height >= 0) or (self.rows > 1 and not self.row_height):
            raise ValueError(
                f"row_height must be a positive length in mm where there is more than one row, got {self.row_height} "
                f"for {self.rows}."
            )
        if not math.isfinite(self.offset):
            raise ValueError(f"The detector's offset must be a finite number of bins, got {self.offset}.")
        if not math.isfinite(self.row_offset):
            raise ValueError(f"row_offset must be a finite number of rows, got {self.row_offset}.")
        if self.kind not in ("arc", "flat"):
            raise ValueError(f'The detector is "arc" or "flat", got "{self.kind}".')

    def __str__(self) -> str:
        rows = f"{self.rows} rows of " if self.rows > 1 else ""
        return f"{rows}{self.bins} bins on {'an arc' if self.kind == 'arc' else 'a flat detector'}"

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and bins."""
        return self.rows, self.bins

    def fan_angles(self, distance: float) -> NDArray[np.float64]:
        """Return γ at the centre of each bin, rad, for a detector at this distance D, mm."""
        return self._fan_angles(np.arange(self.bins, dtype=np.float64), distance)

    def fan_angle_edges(self, distance: float) -> NDArray[np.float64]:
        """Return γ at the bins + 1 edges of the cells, rad, for a detector at this distance D, mm."""
        return self._fan_angles(np.arange(self.bins + 1) - 0.5, distance)

    def _fan_angles(self, number: NDArray[Any], distance: float) -> NDArray[np.float64]:
        along = number - (self.bins - 1) / 2
        if self.kind == "flat":
            return np.arctan((along + self.offset) * self.bin_width / distance)
        pitch = 2 * math.atan(self.bin_width / 2 / distance)
        return along * pitch + math.atan(self.offset * self.bin_width / distance)

    @property
    def row_positions(self) -> NDArray[np.float64]:
        """Height v of the middle of each row above the nominal focal spot, mm at the detector."""
        return self._heights(np.arange(self.rows, dtype=np.float64))

    @property
    def row_edges(self) -> NDArray[np.float64]:
        """Heights of the rows + 1 edges of the rows above the nominal focal spot, mm at the detector."""
        return self._heights(np.arange(self.rows + 1) - 0.5)

    def _heights(self, number: NDArray[Any]) -> NDArray[np.float64]:
        heights: NDArray[np.float64] = (number - (self.rows - 1) / 2 + self.row_offset) * self.row_height
        return heights
