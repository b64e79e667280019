"""Images that a command reads: a file, or a folder with a series of CT images in DICOM."""

from pathlib import Path

from pnpct.arrays import Image, Volume
from pnpct.cli.terminal import say
from pnpct.files import describe_file, evenly_spaced, read_dicom_series, read_image, read_truth, read_volume
from pnpct.geometry import Grid


def image_of(path: Path, series_uid: str | None = None) -> tuple[Image | Volume, Grid]:
    """Read an image or a volume, and say what was done to the images of a DICOM series.

    A series of one slice without a thickness is an image.

    Args:
        path: An image file, .npz with hu, z_mm and spacing_mm among them, or a folder of DICOM images.
        series_uid: SeriesInstanceUID of the series to read, where the folder holds several.

    Raises:
        OSError: If it cannot be read.
        ValueError: If it is no image, or a series is chosen where there is no folder.
    """
    check_series(path, series_uid)
    if path.suffix.lower() == ".npy":
        raise ValueError(f"{path} does not say where its pixels are; save hu, z_mm and spacing_mm by numpy.savez.")
    if not path.is_dir() and path.suffix.lower() != ".npz":
        return read_image(path)
    series = evenly_spaced(read_dicom_series(path, series_uid=series_uid) if path.is_dir() else read_volume(path))
    for note in series.notes:
        say(note)
    if len(series.z) == 1 and series.slice_thickness is None:
        return series.image[0], series.plane
    return series.image, series.grid


def check_series(path: Path, series_uid: str | None) -> None:
    """Check that a series is chosen only in a folder.

    Raises:
        ValueError: If it is chosen elsewhere.
    """
    if series_uid is not None and not path.is_dir():
        raise ValueError(
            f"--series chooses a series in a folder of DICOM images, and {path} is no folder; leave it out."
        )


def truth_of(path: Path, series_uid: str | None = None) -> tuple[Image | Volume, Grid]:
    """Read the truth and its grid, from an image, a volume, a DICOM series or a scan.

    Args:
        path: The file, or the folder of a series.
        series_uid: SeriesInstanceUID of the series to read, where the folder holds several.

    Raises:
        OSError: If the file cannot be read.
        ValueError: If it is none of these, or a scan without its truth.
    """
    if path.is_dir() or path.suffix.lower() != ".h5" or describe_file(path)["format"] != "pnpct-scan":
        return image_of(path, series_uid)
    check_series(path, series_uid)
    if (truth := read_truth(path)) is None:
        raise ValueError(f"{path} is a scan without its truth; give an image to compare with.")
    return truth
