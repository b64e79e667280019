"""CT images in DICOM: where they lie in the patient, and their HU."""

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydicom import Dataset, FileDataset
from pydicom.errors import BytesLengthException, InvalidDicomError
from pydicom.uid import UID, CTImageStorage, MediaStorageDirectoryStorage

from pnpct.files.dicom_frames import FUNCTIONAL_GROUPS, frames_of
from pnpct.files.dicom_open import dcmread_any, stored_pixels
from pnpct.files.errors import FileFormatError
from pnpct.files.image_series import AIR_HU, tidy_hu
from pnpct.files.plausible import check_foreign_image
from pnpct.geometry import ImageGrid

_GEOMETRY = ("Rows", "Columns", "PixelSpacing", "ImageOrientationPatient", "ImagePositionPatient", "SliceThickness")
_RESCALE = ("RescaleSlope", "RescaleIntercept", "RescaleType")
_PADDING = ("PixelPaddingValue", "PixelPaddingRangeLimit", "PixelRepresentation")
_KIND = ("SOPClassUID", "Modality", "ImageType", "SeriesInstanceUID", "NumberOfFrames")
# Words from fixed lists or about the machine only: free text may name the patient.
_DESCRIPTION = ("BodyPartExamined", "Manufacturer", "ManufacturerModelName", "ConvolutionKernel", "KVP")
_TAGS = (*_GEOMETRY, *_RESCALE, *_PADDING, *_KIND, *_DESCRIPTION, *FUNCTIONAL_GROUPS)
_HIGHEST_HU = 31743
"""The highest number of scanners, on their extended scale: 15 bits from -1024 HU on."""

_DEFERRED_BYTES = 1024
_STEEPEST = 0.75
"""Sine of the largest tilt of a gantry, and more: 49 degrees."""
_NAMES_OF_DICOM = {".dcm", ".dicom", ".ima"}
DAMAGE = (
    AttributeError,
    BytesLengthException,
    EOFError,
    KeyError,
    NotImplementedError,
    OSError,
    OverflowError,
    RuntimeError,
    TypeError,
    ValueError,
    struct.error,
)
"""What pydicom raises for files that are cut or damaged."""


@dataclass(frozen=True)
class Layout:
    """What all images of a series share.

    Args:
        rows: Number of rows in the file.
        cols: Number of columns in the file.
        spacing: Distance between pixel centres, mm.
        along_row: Direction in which the column number grows, (x, y) of the patient: to the left, to the back.
        along_column: Direction in which the row number grows.
        rise: Height gained per mm in that direction: not 0 where the gantry was tilted.
    """

    rows: int
    cols: int
    spacing: float
    along_row: tuple[int, int]
    along_column: tuple[int, int]
    rise: float = 0.0

    def upright(self, image: NDArray[Any]) -> NDArray[Any]:
        """Turn an image so that rows go from front to back, columns from the patient's right to the left."""
        if self.along_row[0] == 0:
            return image.T[:: self.along_row[1], :: self.along_column[0]]
        return image[:: self.along_column[1], :: self.along_row[0]]

    def as_stored(self, upright: NDArray[Any]) -> NDArray[Any]:
        """Turn an upright image back to how it is in the file."""
        if self.along_row[0] == 0:
            return upright[:: self.along_row[1], :: self.along_column[0]].T
        return upright[:: self.along_column[1], :: self.along_row[0]]

    def plane(self, position: tuple[float, float]) -> ImageGrid:
        """Return the grid of an upright image; that of a tilted one is around the point that its middle is above.

        Args:
            position: Of the first pixel, (x, y) of the patient: to the left, to the back, mm.
        """
        level = math.sqrt(1 - self.rise**2)
        left, back = (
            first + self.spacing * ((self.cols - 1) * row + (self.rows - 1) * level * column) / 2
            for first, row, column in zip(position, self.along_row, self.along_column, strict=True)
        )
        rows, cols = (self.rows, self.cols) if self.along_row[0] else (self.cols, self.rows)
        return ImageGrid(rows, cols, self.spacing, (left, 0.0 - back))

    def __str__(self) -> str:
        tilt = f", tilted by {math.degrees(math.asin(self.rise)):.1f} degrees" if self.rise else ""
        return (
            f"{self.rows} x {self.cols} pixels of {self.spacing:g} mm along {self.along_row}, {self.along_column}{tilt}"
        )


@dataclass(frozen=True)
class CTSlice:
    """One image, of which only the header is read.

    Args:
        path: Its file.
        header: The elements that are needed, of this frame where the file holds several.
        layout: Its pixels.
        position: Of the first pixel, x, y and z of the patient, mm; z grows towards the head.
        slope: HU per unit of the stored values.
        intercept: HU of a stored 0.
        frame: Its number in a file that holds several, from 0; None where the file is one image.
    """

    path: Path
    header: Dataset
    layout: Layout
    position: tuple[float, float, float]
    slope: float
    intercept: float
    frame: int | None = None

    @property
    def whole_numbers(self) -> bool:
        """Whether its HU are integers."""
        return self.slope.is_integer() and self.intercept.is_integer()

    @property
    def thickness(self) -> float | None:
        """Thickness of the slice, mm; None if it is not a positive number."""
        try:
            (thickness,) = (float(value) for value in values_of(self.header, "SliceThickness"))
        except (TypeError, ValueError):
            return None
        return thickness if 0 < thickness < math.inf else None

    @property
    def description(self) -> str:
        """Body part, scanner, kernel and voltage, as far as they are known."""
        words = {name: " ".join(map(str, values_of(self.header, name))) for name in _DESCRIPTION}
        voltage = words.pop("KVP")
        return ", ".join(["CT", *filter(None, words.values()), *([f"{float(voltage):g} kVp"] if voltage else [])])


def read_image_header(path: Path, also: Sequence[str] = ()) -> FileDataset | None:
    """Read what is needed of a file's header; None if the file is not DICOM or holds no pixels.

    Args:
        path: The file.
        also: Further elements that are needed.

    Raises:
        OSError: If the file cannot be read.
        FileFormatError: If it is damaged, or not DICOM though its name ends like that of one.
    """
    try:
        # The pixels are not read, but that they begin shows that the header is complete.
        header = dcmread_any(path, defer_size=_DEFERRED_BYTES, specific_tags=[*_TAGS, *also, "PixelData"])
        storage = header.file_meta.get("MediaStorageSOPClassUID") or header.get("SOPClassUID")
        if "PixelData" not in header:
            # Only the list of a disc's content has no modality.
            if storage == CTImageStorage or ("Modality" not in header and storage != MediaStorageDirectoryStorage):
                raise EOFError("it ends before its pixels")
            return None
        for name in (*_TAGS, *also):
            header.get(name)  # decoded now, where damage is expected
    except InvalidDicomError as error:
        if path.suffix.lower() in _NAMES_OF_DICOM:
            raise FileFormatError(f"{path} is not a complete DICOM file, though its name says so.") from error
        return None
    except DAMAGE as error:
        raise broken(path, error) from error
    return header


def values_of(header: Dataset, name: str) -> list[Any]:
    """Return the values of an element, which may be none, one or several."""
    value = header.get(name)
    if value is None:
        return []
    return [value] if isinstance(value, str | float | int) else list(value)


def slices_of(path: Path, header: FileDataset) -> list[CTSlice]:
    """Interpret the header of a file: one image, or the frames of an enhanced CT image.

    Args:
        path: The file.
        header: Its header, from `read_image_header`.

    Raises:
        FileFormatError: If an image is not in HU, with square pixels in an axial plane, or in one that was tilted with
            the gantry.
    """
    try:
        frames = frames_of(header)
    except DAMAGE as error:
        raise broken(path, error) from error
    if not frames:
        return [_slice_of(path, header, None)]
    return [_slice_of(path, frame, number) for number, frame in enumerate(frames)]


def _slice_of(path: Path, header: Dataset, frame: int | None) -> CTSlice:
    if int(header.get("NumberOfFrames") or 1) != 1:
        raise FileFormatError(f"{path} holds {header.NumberOfFrames} frames; export the series as one image per file.")
    unit = header.get("RescaleType") or "HU"
    if unit not in ("HU", "US"):  # US: unspecified
        raise FileFormatError(f"{path}: an image in HU was needed, but its values are in {unit}.")
    between_rows, between_cols = _numbers(path, header, "PixelSpacing", 2)
    if not (between_rows > 0 and abs(between_rows - between_cols) <= 1e-4 * between_rows):
        raise FileFormatError(f"{path}: square pixels are needed, got {between_rows:g} x {between_cols:g} mm.")
    along_row, along_column, rise = _directions(path, header)
    (rows,), (cols,) = _numbers(path, header, "Rows", 1), _numbers(path, header, "Columns", 1)
    layout = Layout(int(rows), int(cols), between_rows, along_row, along_column, rise)
    x, y, z = _numbers(path, header, "ImagePositionPatient", 3)
    (slope,), (intercept,) = (_numbers(path, header, name, 1) for name in ("RescaleSlope", "RescaleIntercept"))
    return CTSlice(path, header, layout, (x, y, z), slope, intercept, frame)


def _directions(path: Path, header: Dataset) -> tuple[tuple[int, int], tuple[int, int], float]:
    """Where columns and rows go in the axial plane, and how steeply the rows rise with a tilted gantry."""
    directions = _numbers(path, header, "ImageOrientationPatient", 6)
    rise = round(directions[5], 6) if abs(directions[5]) > 1e-3 else 0.0
    # With the gantry the columns turn about the patient's axis from right to left, and stay of unit length.
    level = [*directions[:4], directions[4] / math.sqrt(1 - rise**2), 0.0] if abs(rise) < _STEEPEST else directions
    along = [round(direction) for direction in level]
    oblique = max(abs(exact - near) for exact, near in zip(level, along, strict=True)) > 1e-3
    sideways = [abs(direction) for direction in along] == [0, 1, 0, 1, 0, 0]
    # Axial: one of x and y along the rows, the other along the columns.
    if oblique or not ([abs(direction) for direction in along] == [1, 0, 0, 0, 1, 0] or (sideways and not rise)):
        raise FileFormatError(
            f"{path}: axial images are needed, at most tilted with the gantry, but the rows and columns of this one go "
            f"along {directions} (ImageOrientationPatient)."
        )
    return (along[0], along[1]), (along[3], along[4]), rise


def hu_of(one: CTSlice) -> NDArray[np.int16] | NDArray[np.float32]:
    """Read the pixels of an image, in HU and upright; padding is air.

    Args:
        one: The image.

    Raises:
        OSError: If the file cannot be read.
        FileFormatError: If it is cut, not grey, or compressed in a way that no installed decoder knows.
    """
    try:
        stored = stored_pixels(one.path, one.frame)
    except DAMAGE as error:
        syntax = UID(one.header.file_meta.get("TransferSyntaxUID", ""))
        if isinstance(error, NotImplementedError | RuntimeError) and syntax.is_transfer_syntax and syntax.is_compressed:
            raise FileFormatError(
                f"{one.path}: the image is compressed ({syntax.name}) and cannot be decoded here; decompress the "
                "series first."
            ) from error
        raise broken(one.path, error) from error
    if stored.shape != (one.layout.rows, one.layout.cols):
        raise FileFormatError(f"{one.path}: a grey image was needed, got values of the shape {stored.shape}.")
    hu = stored * one.slope + one.intercept
    check_foreign_image(one.path, float(hu.min()), float(hu.max()), one.layout.plane(one.position[:2]), own=True)
    if one.header.get("PixelPaddingValue") is not None:
        limit = "PixelPaddingRangeLimit" if "PixelPaddingRangeLimit" in one.header else "PixelPaddingValue"
        ends = [_numbers(one.path, one.header, name, 1)[0] for name in ("PixelPaddingValue", limit)]
        # As the pixels are stored: some scanners write the padding of signed pixels without its sign.
        low, high = sorted(np.array(ends).astype(np.int64).astype(stored.dtype).tolist())
        hu[(stored >= low) & (stored <= high)] = AIR_HU
    if stored.dtype.kind == "u":
        hu[hu > _HIGHEST_HU] = AIR_HU  # padding below 0 that was stored without its sign, and without its tag
    if one.whole_numbers:
        hu = np.clip(hu, np.iinfo(np.int16).min, np.iinfo(np.int16).max).astype(np.int16)
    return tidy_hu(one.layout.upright(hu))


def _numbers(path: Path, header: Dataset, name: str, count: int) -> list[float]:
    """The finite numbers of an element; there must be just as many."""
    try:
        numbers = [float(value) for value in values_of(header, name)]
    except (TypeError, ValueError):
        numbers = []
    if len(numbers) != count or not np.isfinite(numbers).all():
        raise FileFormatError(f"{path}: this image has no {name}, or not as {count} finite numbers; it cannot be used.")
    return numbers


def broken(path: Path, error: Exception) -> Exception:
    """Return what is to be raised where pydicom has raised one of `DAMAGE`."""
    if isinstance(error, OSError) and error.errno is not None:
        return error  # nothing is known about the content
    reason = " ".join(str(error).split()).rstrip(".")
    return FileFormatError(f"{path}: this is not a complete DICOM image ({reason}).")
