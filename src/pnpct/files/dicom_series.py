"""CT series in DICOM: a folder of single images becomes one volume in HU."""

import warnings
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float32, Int16
from pydicom import FileDataset
from pydicom.uid import SecondaryCaptureImageStorage

from pnpct.files.dicom_image import CTSlice, hu_of, read_image_header, slices_of, values_of
from pnpct.files.errors import FileFormatError, PathLike
from pnpct.files.image_series import ImageSeries, check_heights
from pnpct.files.series_resampling import without_tilt


def read_dicom_series(folder: PathLike, *, series_uid: str | None = None) -> ImageSeries:
    """Read a folder that holds one axial CT series, one image per file.

    Files that are not DICOM, objects without pixels, images of other modalities, screen captures and
    localizer images are passed over; folders within the folder are not entered. Slices are ordered by their
    position, whatever the files are called. Images are turned so that the patient's front is at the top and
    the left side at +x, also of patients who lay on the front or on a side; positions are those of the file, in
    the coordinates of the patient (our y is to the front, DICOM's to the back). The description is made of body
    part, scanner, kernel and voltage; nothing that could identify the patient is stored. Compressed images are read
    as far as the installed decoders go, enhanced (multi-frame) CT images as their frames. Where the gantry was tilted,
    the images are resampled to axial planes by linear interpolation, which the notes of the series say.

    Args:
        folder: The folder.
        series_uid: SeriesInstanceUID of the series to read, where the folder holds several.

    Returns:
        The series, int16 where all slopes and intercepts are whole numbers (cut off at 32767 HU), else
        float32. Padding, and what is below -1024 HU, has become air.

    Raises:
        OSError: If there is no such folder or a file cannot be read.
        FileFormatError: If there is no CT image, or several series; if a slice is missing, comes twice or
            does not fit the others; if images are oblique, have oblong pixels, are not in HU, or cannot be
            decoded; if there is a single tilted one.

    References:
        DICOM PS3.3, C.7.6.2 (image plane) and C.8.2.1 (CT image).
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pydicom's, of values that are against the standard and do no harm
        return _read(Path(folder), series_uid)


def read_slices(folder: Path, series_uid: str | None, *, also: Sequence[str] = ()) -> list[CTSlice]:
    """Read the headers of one CT series, as `read_dicom_series` does.

    Args:
        folder: The folder.
        series_uid: SeriesInstanceUID of the series, where there are several.
        also: Further elements that the headers should have.

    Returns:
        The slices, alike but for their height, the lowest first.

    Raises:
        OSError: If there is no such folder or a file cannot be read.
        FileFormatError: If there is no such series, or a slice does not fit the others.
    """
    if not folder.is_dir():
        raise NotADirectoryError(f"{folder} is no folder; give the folder that holds the files of one CT series.")
    headers = _chosen_series(folder, _ct_headers(folder, also), series_uid)
    slices = sorted(
        (one for path, header in headers for one in slices_of(path, header)), key=lambda one: one.position[2]
    )
    _check_alike(slices)
    return slices


def hu_of_all(
    slices: Sequence[CTSlice],
) -> Int16[np.ndarray, "slices rows cols"] | Float32[np.ndarray, "slices rows cols"]:
    """Read the pixels of the slices of a series, in HU and upright.

    Raises:
        OSError: If a file cannot be read.
        FileFormatError: If one is cut, not grey, or cannot be decoded.
    """
    first = hu_of(slices[0])
    whole = all(one.whole_numbers for one in slices)
    image_hu = np.empty((len(slices), *first.shape), dtype=np.int16 if whole else np.float32)
    image_hu[0] = first
    for index, one in enumerate(slices[1:], start=1):
        image_hu[index] = hu_of(one)
    return image_hu


def _read(folder: Path, series_uid: str | None) -> ImageSeries:
    slices = read_slices(folder, series_uid)
    lowest, layout = slices[0], slices[0].layout
    to_middle = layout.rise * layout.spacing * (layout.rows - 1) / 2
    z = tuple(one.position[2] + to_middle for one in slices)
    try:
        check_heights(z)
        plane = layout.plane(lowest.position[:2])
        series = ImageSeries(hu_of_all(slices), plane, z, lowest.description, lowest.thickness)
        return without_tilt(series, layout.rise * layout.along_column[1]) if layout.rise else series
    except FileFormatError:
        raise
    except ValueError as error:
        raise FileFormatError(f"{folder}: {error}") from error


def _ct_headers(folder: Path, also: Sequence[str]) -> list[tuple[Path, FileDataset]]:
    """The headers of all CT images but localizers and screen captures."""
    found: list[tuple[Path, FileDataset]] = []
    others: Counter[str] = Counter()
    for path in sorted(folder.iterdir()):
        if path.name.startswith(".") or not path.is_file():
            continue
        header = read_image_header(path, also)
        if header is None:
            continue
        kind = _kind(header)
        if kind == "CT":
            found.append((path, header))
        else:
            others[kind] += 1
    if not found:
        kinds = ", ".join(f"{kind} ({count})" for kind, count in others.items())
        but = f", only other images: {kinds}" if kinds else ""
        raise FileFormatError(f"{folder} holds no CT image in DICOM{but}; give the folder that holds the slices.")
    return found


def _kind(header: FileDataset) -> str:
    """What kind of image it is: "CT" for one to read."""
    if header.get("Modality") != "CT":
        return f"modality {header.get('Modality') or 'unknown'}"
    if "LOCALIZER" in values_of(header, "ImageType"):
        return "localizer"
    return "screen capture" if header.get("SOPClassUID") == SecondaryCaptureImageStorage else "CT"


def _chosen_series(
    folder: Path, headers: Sequence[tuple[Path, FileDataset]], series_uid: str | None
) -> list[tuple[Path, FileDataset]]:
    uids = [str(header.get("SeriesInstanceUID") or "") for _, header in headers]
    counts = Counter(uids)
    listed = ", ".join(f"{uid or 'without a uid'} ({count} images)" for uid, count in counts.items())
    if series_uid is None and len(counts) > 1:
        raise FileFormatError(
            f"{folder} holds {len(counts)} CT series; choose one with --series (series_uid in Python), or put "
            f"it into a folder of its own: {listed}."
        )
    chosen = uids[0] if series_uid is None else series_uid
    if chosen not in counts:
        raise FileFormatError(f"{folder} holds no CT series {chosen}; it holds {listed}.")
    return [file for file, uid in zip(headers, uids, strict=True) if uid == chosen]


def _check_alike(slices: Sequence[CTSlice]) -> None:
    """Check that all slices have the layout of the first, straight above it."""
    first = slices[0]
    for one in slices[1:]:
        if one.layout != first.layout:
            raise FileFormatError(
                f"{one.path} does not fit {first.path.name}: it has {one.layout}, the other {first.layout}."
            )
        shift = max(abs(one.position[0] - first.position[0]), abs(one.position[1] - first.position[1]))
        if shift > 0.1 * first.layout.spacing:
            raise FileFormatError(
                f"{one.path} lies {shift:g} mm beside {first.path.name}; slices must lie straight above one another."
            )
