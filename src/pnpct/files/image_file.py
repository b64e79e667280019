"""Images and volumes on disk: HDF5 for further processing, NIfTI for viewers, PNG to look at.

HDF5 holds attenuation relative to water; NIfTI and PNG show HU.
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np

from pnpct.arrays import Image, Volume
from pnpct.files.atomic import atomic_path
from pnpct.files.errors import PathLike
from pnpct.files.hdf5 import new_hdf5, open_hdf5, read_image_dataset, write_image_dataset
from pnpct.files.provenance import Provenance, record_run
from pnpct.geometry import Grid
from pnpct.units import to_hu

FORMAT = "pnpct-image"
WINDOW = (30.0, 300.0)
"""Level and width of the window of a PNG, HU."""

_DIVERGED_HU = 1e9
"""What no image has, nor a map of other values."""

_NARROWEST_WINDOW, _WIDEST_WINDOW = 1e-3, 1e5


def write_image(
    path: PathLike,
    image: Image | Volume,
    grid: Grid,
    *,
    provenance: Provenance | None = None,
    window: tuple[float, float] = WINDOW,
) -> None:
    """Write an image or a volume in the format that the suffix names.

    .h5 stores it relative to water as float32, with any batch. .nii and .nii.gz store the HU of one image or one
    volume as float32, slices along the third axis. .png shows HU through a window in 256 greys, slices (or a
    batch of images) side by side. The provenance is in each of them.

    Args:
        path: File to write, .h5, .nii, .nii.gz or .png; an existing one is replaced.
        image: The image or volume, relative to water.
        grid: Where its pixels are.
        provenance: How it was made; if None, by the program that is running.
        window: Level and width of the window of a PNG, HU.

    Raises:
        OSError: If the file cannot be written.
        ValueError: If the suffix is another, the image does not fit its grid or is not finite, there is a batch
            for NIfTI or more than one row of images for PNG, or the window is not positive.
    """
    suffix, provenance = _suffix(path), provenance or record_run(sys.argv)
    batch = image.ndim - len(grid.shape)
    if tuple(image.shape[batch:]) != grid.shape:
        raise ValueError(f"The image must end in the grid's {grid.shape}, got {tuple(image.shape)}.")
    if not image.isfinite().all():
        raise ValueError(f"{path} was not written: the image holds values that are not finite.")
    if (largest := float(to_hu(image.detach()).abs().max())) > _DIVERGED_HU:
        raise ValueError(f"{path} was not written: the image holds {largest:.4g} HU, more than any matter has.")
    if suffix.startswith(".nii") and batch:
        raise ValueError(
            f"{suffix} files hold one image or one volume, got a batch of the shape {tuple(image.shape)}; use .h5."
        )
    if suffix == ".png" and image.ndim > 3:
        raise ValueError(
            f"{suffix} files hold an image or one row of slices, got the shape {tuple(image.shape)}; use .h5."
        )
    image = image.detach().cpu()
    if suffix == ".h5":
        with new_hdf5(path, file_format=FORMAT, provenance=provenance, description="") as file:
            write_image_dataset(file, image, grid, description="reconstructed image")
    elif suffix == ".png":
        _write_png(path, image, provenance, window)
    else:
        from pnpct.files.nifti_file import write_nifti

        write_nifti(path, _hu_array(image), grid, provenance)


def read_image(path: PathLike) -> tuple[Image | Volume, Grid]:
    """Read an image or a volume relative to water, and its grid, from .h5, .nii or .nii.gz.

    A NIfTI file may come from elsewhere if it holds HU and its axes are those of the patient. With two dimensions
    it is an image, with three (or four, at one time) a volume, also of a single slice.

    Raises:
        OSError: If there is no such file or it cannot be read.
        ValueError: If the suffix is another.
        FileFormatError: If the content is incomplete or not an image.
    """
    suffix = _suffix(path)
    if suffix == ".png":
        raise ValueError(f"{path}: a PNG shows 256 greys of a window, not HU; read the .h5 or .nii of this image.")
    if suffix != ".h5":
        from pnpct.files.nifti_file import read_nifti

        return read_nifti(path)
    with open_hdf5(path, formats=(FORMAT,)) as file:
        return read_image_dataset(file)


def check_window(window: tuple[float, float]) -> None:
    """Check that a level and a width in HU show something.

    Raises:
        ValueError: If the level is beyond ±100,000 HU, or the width not from 0.001 to 100,000 HU.
    """
    level, width = window
    if not (abs(level) <= _WIDEST_WINDOW and _NARROWEST_WINDOW <= width <= _WIDEST_WINDOW):
        raise ValueError(f"A window is a level and a positive width in HU, got {window}.")


def _suffix(path: PathLike) -> str:
    name = Path(path).name.lower()
    for suffix in (".h5", ".nii", ".nii.gz", ".png"):
        if name.endswith(suffix):
            return suffix
    series = " a DICOM series is given by its folder;" if name.endswith((".dcm", ".ima")) else ""
    raise ValueError(f"Images are stored as .h5, .nii, .nii.gz or .png;{series} got {Path(path).name}.")


def _hu_array(image: Image | Volume) -> np.ndarray[Any, np.dtype[np.float64]]:
    """HU in double precision, slices first."""
    return np.asarray(to_hu(image.double()).reshape(-1, *image.shape[-2:]))


def _write_png(path: PathLike, image: Image | Volume, provenance: Provenance, window: tuple[float, float]) -> None:
    from PIL import Image as Picture
    from PIL.PngImagePlugin import PngInfo

    check_window(window)
    level, width = window
    montage = np.concatenate(list(_hu_array(image)), axis=1)
    greys = np.rint(np.clip((montage - level) / width + 0.5, 0.0, 1.0) * 255).astype(np.uint8)
    text = PngInfo()
    text.add_itxt("Comment", provenance.to_json())
    with atomic_path(path) as temporary:
        Picture.fromarray(greys).save(temporary, pnginfo=text)
