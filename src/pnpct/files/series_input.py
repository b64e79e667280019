"""The images of one patient in HU, from whatever holds them."""

from pathlib import Path

import numpy as np

from pnpct.files.dicom_series import read_dicom_series
from pnpct.files.errors import FileFormatError, PathLike
from pnpct.files.image_file import read_image
from pnpct.files.image_series import ImageSeries, read_volume
from pnpct.geometry import VolumeGrid
from pnpct.units import to_hu

SUFFIXES = (".h5", ".nii", ".nii.gz", ".npz", ".npy")
"""Of files that hold images of a patient; a folder holds a series in DICOM."""


def read_series(path: PathLike) -> ImageSeries:
    """Read the images of one patient from a folder (DICOM), .h5, .nii, .nii.gz, or an array of HU (.npz, .npy).

    A .npz file has hu, z_mm and spacing_mm, as for `read_volume`. A .npy file has no positions: it gets pixels and
    slices 1 mm apart, which is for those who do not use them.

    Args:
        path: The folder or file.

    Raises:
        OSError: If there is no such file or it cannot be read.
        FileFormatError: If it holds no images of one patient in HU.
        ValueError: If the suffix is another.
    """
    path = Path(path)
    if path.is_dir():
        return read_dicom_series(path)
    if path.suffix == ".npy":
        return read_volume(path, pixel_spacing=1.0, slice_spacing=1.0)
    if path.suffix == ".npz":
        return read_volume(path)
    image, grid = read_image(path)
    if image.ndim != len(grid.shape):
        raise FileFormatError(f"{path}: images of one patient are needed, but this is a batch, {tuple(image.shape)}.")
    image_hu = np.asarray(to_hu(image).float()).reshape(-1, *image.shape[-2:])
    if isinstance(grid, VolumeGrid):
        thickness = grid.slice_spacing if grid.slices == 1 else None
        return ImageSeries(image_hu, grid.plane, tuple(grid.heights.tolist()), path.name, thickness)
    return ImageSeries(image_hu, grid, (0.0,), path.name)
