"""The truth that an image is compared with."""

from pathlib import Path

from pnpct.arrays import Image
from pnpct.files import describe_file, read_image, read_truth
from pnpct.geometry import ImageGrid


def truth_of(path: Path) -> tuple[Image, ImageGrid]:
    """Read the truth and its grid, from an image or from the inside of a scan.

    Raises:
        OSError: If the file cannot be read.
        ValueError: If it is neither, or a scan without the truth inside.
    """
    if path.suffix.lower() != ".h5" or describe_file(path)["format"] != "pnpct-scan":
        return read_image(path)
    if (truth := read_truth(path)) is None:
        raise ValueError(f"{path} is a scan without the truth inside; give an image to compare with.")
    return truth


def check_same_grid(grid: ImageGrid, other: ImageGrid) -> None:
    """Check that an image and the truth have their pixels at the same places, to a hundredth of a pixel.

    Raises:
        ValueError: If they have not.
    """
    if grid.shape != other.shape:
        raise ValueError(f"The image has {_size(grid)} pixels, the truth {_size(other)}; reconstruct on its grid.")
    away = max(abs(a - b) for a, b in zip(_corners(grid), _corners(other), strict=True))
    if away > 0.01 * other.spacing:
        raise ValueError(
            f"The pixels of the image are not where those of the truth are: {_place(grid)} against {_place(other)}; "
            "reconstruct on its grid."
        )


def _size(grid: ImageGrid) -> str:
    return f"{grid.rows} x {grid.cols}"


def _place(grid: ImageGrid) -> str:
    return f"{grid.spacing:.6g} mm apart around ({grid.center[0]:g}, {grid.center[1]:g}) mm"


def _corners(grid: ImageGrid) -> tuple[float, ...]:
    return tuple(float(value) for value in (grid.x[0], grid.x[-1], grid.y[0], grid.y[-1]))
