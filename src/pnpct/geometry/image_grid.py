"""A grid of square pixels."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

FARTHEST = 1e6
"""Of a pixel from the isocentre, mm: what lies farther is a damaged number."""


@dataclass(frozen=True)
class ImageGrid:
    """Square pixels with x to the right and y up: row 0 is the largest y, column 0 the smallest x.

    Args:
        rows: Number of rows, at least 1.
        cols: Number of columns, at least 1.
        spacing: Distance between pixel centres, mm.
        center: Position (x, y) of the middle of the grid relative to the isocentre, mm.

    Raises:
        ValueError: If a size or the spacing is not positive, or a pixel more than a kilometre away.

    Example:
        >>> grid = ImageGrid(2, 4, spacing=0.5)
        >>> grid.x.tolist(), grid.y.tolist()
        ([-0.75, -0.25, 0.25, 0.75], [0.25, -0.25])
        >>> grid.halved.y.tolist()
        [0.375, 0.125, -0.125, -0.375]
    """

    rows: int
    cols: int
    spacing: float
    center: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        if self.rows < 1 or self.cols < 1:
            raise ValueError(f"An image needs at least one row and one column, got {self.rows} x {self.cols}.")
        if not (math.isfinite(self.spacing) and self.spacing > 0):
            raise ValueError(f"The pixel spacing must be a positive length in mm, got {self.spacing}.")
        if len(self.center) != 2 or not all(map(math.isfinite, self.center)):
            raise ValueError(f"The centre of an image is (x, y) in mm, got {self.center}.")
        if self.radius > FARTHEST:
            raise ValueError(f"An image must lie within 1 km of the isocentre, got {self} around {self.center} mm.")

    def __str__(self) -> str:
        return f"{self.rows} x {self.cols} pixels of {self.spacing:.4g} mm"

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.rows, self.cols

    @property
    def plane(self) -> "ImageGrid":
        """Itself: the pixels of each slice, as volumes have them."""
        return self

    @property
    def halved(self) -> "ImageGrid":
        """The same square in pixels of half the spacing, as phantoms are scanned for images of this grid."""
        return replace(self, rows=2 * self.rows, cols=2 * self.cols, spacing=self.spacing / 2)

    @property
    def x(self) -> NDArray[np.float64]:
        """Positions of the columns, mm."""
        x: NDArray[np.float64] = np.arange(self.cols, dtype=np.float64) - (self.cols - 1) / 2
        return self.center[0] + x * self.spacing

    @property
    def y(self) -> NDArray[np.float64]:
        """Positions of the rows, mm; falling."""
        y: NDArray[np.float64] = np.arange(self.rows, dtype=np.float64) - (self.rows - 1) / 2
        return self.center[1] - y * self.spacing

    @property
    def radius(self) -> float:
        """Distance from the isocentre to the farthest corner, mm."""
        half_width, half_height = self.cols * self.spacing / 2, self.rows * self.spacing / 2
        return math.hypot(abs(self.center[0]) + half_width, abs(self.center[1]) + half_height)
