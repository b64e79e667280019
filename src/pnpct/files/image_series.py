"""Series of CT images in HU, one above the other, and how to make one of plain arrays."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from jaxtyping import Float32, Int16
from numpy.typing import NDArray

from pnpct.arrays import Volume
from pnpct.files.array_file import load_array
from pnpct.files.errors import FileFormatError, PathLike
from pnpct.files.plausible import check_foreign_image
from pnpct.geometry import ImageGrid, VolumeGrid
from pnpct.units import from_hu

AIR_HU = -1000
LOWEST_HU = -1024
"""The lowest number that scanners give to tissue or air; lower values stand for pixels that were not imaged."""
_GAP = 0.2
_UNEVEN_HEIGHT = 0.1


@dataclass(frozen=True, eq=False)
class ImageSeries:
    """Axial CT images of one patient, oriented as all images here: front at the top, patient's left at +x.

    It holds no name, number or date of a patient.

    Args:
        image_hu: HU, slices from the feet to the head; pixels that were not imaged are air, -1000 HU.
        plane: Where the pixels are, as in the file; (0, 0) is the centre if it has none.
        z: Heights of the slices, mm, growing towards the head, without a gap.
        description: Where the images come from, in words: scanner, kernel, voltage.
        slice_thickness: As in the file, mm; None if it has none. It is the spacing of a single slice.
        notes: What was done to the images of the file, a sentence each, for the user to read.

    Raises:
        ValueError: If the sizes do not fit together, a value is not finite, or the heights do not grow or
            leave a gap.

    Example:
        >>> series = ImageSeries(np.zeros((2, 4, 4), np.int16), ImageGrid(4, 4, 0.8), (10.0, 13.0), "water")
        >>> series.grid.slice_spacing, series.grid.z
        (3.0, 11.5)
    """

    image_hu: Int16[np.ndarray, "slices rows cols"] | Float32[np.ndarray, "slices rows cols"]
    plane: ImageGrid
    z: tuple[float, ...]
    description: str
    slice_thickness: float | None = None
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        expected = (len(self.z), *self.plane.shape)
        if self.image_hu.shape != expected:
            raise ValueError(f"{len(self.z)} slices on this grid have the shape {expected}, got {self.image_hu.shape}.")
        if self.image_hu.dtype.kind == "f" and not np.isfinite(self.image_hu).all():
            raise ValueError("The images of a series must be finite HU; some pixels are not a number or infinite.")
        check_heights(self.z)

    @property
    def is_even(self) -> bool:
        """Whether the slices are evenly spaced, within a tenth of their mean distance."""
        even = np.linspace(self.z[0], self.z[-1], len(self.z))
        return bool(np.abs(even - self.z).max() <= _UNEVEN_HEIGHT * (even[1] - even[0] if len(even) > 1 else 1.0))

    @property
    def image(self) -> Volume:
        """The images relative to water."""
        return from_hu(torch.from_numpy(self.image_hu.astype(np.float32)))

    @property
    def grid(self) -> VolumeGrid:
        """Where the pixels are, with the mean distance of neighbouring slices.

        Raises:
            ValueError: If there is one slice alone and no thickness is known, or the slices are not evenly spaced.
        """
        if not self.is_even:
            raise ValueError("The slices of this series are not evenly spaced; resample it with evenly_spaced first.")
        slices, (low, high) = len(self.z), (self.z[0], self.z[-1])
        spacing = (high - low) / (slices - 1) if slices > 1 else self.slice_thickness
        if spacing is None:
            raise ValueError(f"The thickness of the only slice, at z = {low:g} mm, is not known; give slice_thickness.")
        return VolumeGrid(self.plane, slices, spacing, (low + high) / 2)


def check_heights(z: Sequence[float]) -> None:
    """Check that slices follow one another without a gap; their distance may change from place to place.

    Args:
        z: Heights of the slices, mm.

    Raises:
        ValueError: If there is none, one is not finite, they do not grow, or a slice seems to be missing: a distance is
            larger by more than 20 % than those on both of its sides.
    """
    if not len(z):
        raise ValueError("A series needs at least one slice, got none.")
    if not all(map(math.isfinite, z)):
        raise ValueError("The heights of slices must be finite lengths in mm; some are not.")
    steps = np.diff(z)
    if len(steps) == 0:
        return
    at = int(np.argmin(steps))
    if steps[at] < 0:
        raise ValueError(f"The heights of slices must grow, but z = {z[at + 1]:g} mm follows on {z[at]:g} mm.")
    if steps[at] < 1e-3:
        raise ValueError(f"Two slices are at the same height, z = {z[at]:g} mm; keep one acquisition only.")
    beside = np.maximum(steps[:-2], steps[2:])
    for gap in np.flatnonzero(steps[1:-1] > (1 + _GAP) * beside).tolist():
        raise ValueError(
            f"A slice is missing: there is none from z = {z[gap + 1]:g} to {z[gap + 2]:g} mm, where the others are "
            f"{beside[gap]:g} mm apart."
        )


def read_volume(
    path: PathLike, *, pixel_spacing: float | None = None, slice_spacing: float | None = None
) -> ImageSeries:
    """Read a CT volume in HU from a NumPy file.

    A .npz file may hold everything: hu, [slices, rows, cols]; z_mm, the height of each slice; spacing_mm, the
    distance between rows and between columns. Any other array, in a .npy file or as a member of a .npz file
    ("scan.npz:volume"), needs both spacings; the middle of such a volume is at z = 0. Row 0 must be the
    patient's front and column 0 the right side, in every file; slices may come in either order only where
    z_mm tells it, else the first is the lowest.

    Args:
        path: The file.
        pixel_spacing: Distance between pixel centres, mm, > 0, where the file does not give it.
        slice_spacing: Distance between slices, mm, > 0, where the file does not give it.

    Returns:
        The series; HU below -1024 have become air. Integers in the range of int16 stay such, all else is
        float32.

    Raises:
        OSError: If there is no such file or it cannot be read.
        FileFormatError: If it is not a complete NumPy file, an array is missing or not clear, or it holds no
            CT volume.
        ValueError: If a spacing is needed and not given, or not positive.
    """
    if pixel_spacing is None and slice_spacing is None:
        return _read_described(path)
    if pixel_spacing is None or slice_spacing is None:
        raise ValueError("A volume without spacings needs both of them, pixel_spacing and slice_spacing in mm.")
    for name, spacing in (("pixel_spacing", pixel_spacing), ("slice_spacing", slice_spacing)):
        if not (math.isfinite(spacing) and spacing > 0):
            raise ValueError(f"{name} must be a positive length in mm, got {spacing}.")
    volume = load_array(path)
    slices = len(volume) if volume.ndim else 0
    heights = (np.arange(slices) - (slices - 1) / 2) * slice_spacing
    return _series(path, volume, heights, pixel_spacing, slice_spacing)


def tidy_hu(values: NDArray[Any]) -> NDArray[np.int16] | NDArray[np.float32]:
    """Return HU as int16 or float32, with all that is below -1024 HU turned into air.

    Args:
        values: HU; integers that int16 can hold stay integers.
    """
    int16 = np.iinfo(np.int16)
    fits = values.dtype.kind in "iu" and int16.min <= int(values.min()) and int(values.max()) <= int16.max
    with np.errstate(over="ignore"):  # what becomes infinite is refused where a series is born
        tidy: Any = values.astype(np.int16 if fits else np.float32)
    tidy[tidy < LOWEST_HU] = AIR_HU
    result: NDArray[np.int16] | NDArray[np.float32] = tidy
    return result


def _read_described(path: PathLike) -> ImageSeries:
    if not str(path).endswith(".npz"):
        raise ValueError(f"{path} has no spacings; give pixel_spacing and slice_spacing in mm.")
    try:
        volume, z, spacing = (load_array(f"{path}:{name}") for name in ("hu", "z_mm", "spacing_mm"))
    except FileFormatError as error:
        raise FileFormatError(
            f"{error} A volume is read from hu, z_mm and spacing_mm, or from one array with both spacings given."
        ) from error
    if spacing.shape not in ((), (2,)) or z.ndim != 1:
        raise FileFormatError(
            f"{path}: spacing_mm must hold one or two lengths and z_mm one per slice, got the shapes "
            f"{spacing.shape} and {z.shape}."
        )
    between_rows, between_cols = np.broadcast_to(spacing, 2).tolist()
    if abs(between_rows - between_cols) > 1e-4 * abs(between_rows):
        raise FileFormatError(f"{path}: square pixels are needed, got {between_rows:g} x {between_cols:g} mm.")
    return _series(path, volume, z, between_rows)


def _series(
    path: PathLike,
    volume: NDArray[Any],
    z: NDArray[Any],
    pixel_spacing: float,
    slice_thickness: float | None = None,
) -> ImageSeries:
    if volume.ndim != 3 or volume.size == 0:
        raise FileFormatError(f"{path}: a volume [slices, rows, cols] was needed, got the shape {volume.shape}.")
    if len(z) > 1 and z[0] > z[-1]:
        volume, z = volume[::-1], z[::-1]
    try:
        plane = ImageGrid(volume.shape[1], volume.shape[2], float(pixel_spacing))
        check_foreign_image(path, float(volume.min()), float(volume.max()), plane)
        heights = tuple(z.astype(np.float64).tolist())
        return ImageSeries(tidy_hu(volume), plane, heights, "CT volume from a NumPy file", slice_thickness)
    except FileFormatError:
        raise
    except ValueError as error:
        raise FileFormatError(f"{path}: {error}") from error
