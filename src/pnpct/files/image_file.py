"""Images on disk: HDF5 to go on with, NIfTI for viewers, PNG to look at.

HDF5 holds attenuation relative to water; NIfTI and PNG show HU. In NIfTI the object lies as a patient does on
the back, head first, seen from the feet: our x grows towards the patient's left, our y towards the front.
Viewers in the radiological convention then show the picture as it is here. The voxels are stored in the order
that NIfTI calls RAS+ (first axis towards the patient's right, second towards the front, third towards the
head), so with x reversed.
"""

import gzip
import zlib
from pathlib import Path
from typing import Any

import nibabel as nib
import numpy as np
import torch
from nibabel.filebasedimages import ImageFileError
from nibabel.spatialimages import HeaderDataError
from PIL import Image as Picture
from PIL.PngImagePlugin import PngInfo

from pnpct.arrays import Image
from pnpct.files.atomic import atomic_path
from pnpct.files.errors import FileFormatError, PathLike, existing_file
from pnpct.files.hdf5 import new_hdf5, open_hdf5, read_image_dataset, write_image_dataset
from pnpct.files.provenance import Provenance
from pnpct.geometry import ImageGrid
from pnpct.units import from_hu, to_hu

FORMAT = "pnpct-image"


def write_image(
    path: PathLike,
    image: Image,
    grid: ImageGrid,
    *,
    provenance: Provenance,
    window: tuple[float, float] = (30.0, 300.0),
    slice_spacing: float = 1.0,
) -> None:
    """Write an image, or a batch of them as slices, in the format that the suffix names.

    .h5 keeps the image relative to water as float32. .nii and .nii.gz keep HU as float32, slices along the
    third axis. .png shows HU through a window in 256 greys, slices side by side. The provenance is in each of
    them.

    Args:
        path: Where the file shall be: .h5, .nii, .nii.gz or .png; an older one is replaced.
        image: The image, relative to water.
        grid: Where its pixels are.
        provenance: How it was made.
        window: Level and width of the window of a PNG, HU.
        slice_spacing: Distance between the slices of a NIfTI file, mm.

    Raises:
        OSError: If the file cannot be written.
        ValueError: If the suffix is another, the image does not fit its grid or is not finite, there is more
            than one batch dimension for NIfTI or PNG, or the window or the slice spacing is not positive.
    """
    suffix = _suffix(path)
    if tuple(image.shape[-2:]) != grid.shape:
        raise ValueError(f"The image must end in the grid's {grid.shape}, got {tuple(image.shape)}.")
    if not image.isfinite().all():
        raise ValueError(f"{path} was not written: the image holds values that are not finite.")
    if suffix != ".h5" and image.ndim > 3:
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
        _write_nifti(path, image, grid, provenance, slice_spacing)


def read_image(path: PathLike) -> tuple[Image, ImageGrid]:
    """Read an image relative to water, and its grid, from .h5, .nii or .nii.gz.

    A NIfTI file may come from elsewhere if it holds HU and its axes are those of the patient; one slice
    becomes an image without a batch, more become a batch.

    Raises:
        OSError: If there is no such file or it cannot be read.
        ValueError: If the suffix is another.
        FileFormatError: If the content is not whole or not an image.
    """
    suffix = _suffix(path)
    if suffix == ".png":
        raise ValueError(f"{path}: a PNG shows 256 greys of a window, not HU; read the .h5 or .nii of this image.")
    if suffix != ".h5":
        return _read_nifti(path)
    with open_hdf5(path, formats=(FORMAT,)) as file:
        return read_image_dataset(file)


def _suffix(path: PathLike) -> str:
    name = Path(path).name.lower()
    for suffix in (".h5", ".nii", ".nii.gz", ".png"):
        if name.endswith(suffix):
            return suffix
    raise ValueError(f"Images are kept as .h5, .nii, .nii.gz or .png, got {Path(path).name}.")


def _hu_array(image: Image) -> np.ndarray[Any, np.dtype[np.float64]]:
    """HU in double precision, slices first."""
    return np.asarray(to_hu(image.double()).reshape(-1, *image.shape[-2:]))


def _write_png(path: PathLike, image: Image, provenance: Provenance, window: tuple[float, float]) -> None:
    level, width = window
    if not (width > 0 and np.isfinite(window).all()):
        raise ValueError(f"The window of a PNG is (level, width) in HU with a positive width, got {window}.")
    montage = np.concatenate(list(_hu_array(image)), axis=1)
    greys = np.rint(np.clip((montage - level) / width + 0.5, 0.0, 1.0) * 255).astype(np.uint8)
    text = PngInfo()
    text.add_itxt("Comment", provenance.to_json())
    with atomic_path(path) as temporary:
        Picture.fromarray(greys).save(temporary, pnginfo=text)


def _write_nifti(path: PathLike, image: Image, grid: ImageGrid, provenance: Provenance, slice_spacing: float) -> None:
    if not 0 < slice_spacing < np.inf:
        raise ValueError(f"The distance between slices must be a positive length in mm, got {slice_spacing}.")
    # From (slice, row, column) to RAS+: the last column is the patient's left, the last row the back.
    voxels = _hu_array(image)[:, ::-1, ::-1].transpose(2, 1, 0).astype(np.float32)
    affine = np.diag([grid.spacing, grid.spacing, slice_spacing, 1.0])
    affine[:2, 3] = -grid.x[-1], grid.y[-1]
    new: Any = nib.Nifti1Image  # nibabel says no types here
    nifti = new(voxels, affine)
    nifti.set_sform(affine, code="scanner")
    nifti.set_qform(affine, code="scanner")
    nifti.header.set_xyzt_units(xyz="mm")
    nifti.header["descrip"] = f"pnpct {provenance.version}, HU".encode()[:79]
    nifti.header.extensions.append(nib.nifti1.Nifti1Extension("comment", provenance.to_json().encode()))
    content = nifti.to_bytes()
    with atomic_path(path) as temporary:
        temporary.write_bytes(gzip.compress(content, mtime=0) if _suffix(path) == ".nii.gz" else content)


def _read_nifti(path: PathLike) -> tuple[Image, ImageGrid]:
    existing_file(path)
    to_canonical: Any = nib.as_closest_canonical  # nibabel says no types here
    try:
        nifti = to_canonical(nib.load(path))
        voxels = np.asarray(nifti.dataobj, dtype=np.float64)
    except (ImageFileError, HeaderDataError, EOFError, OSError, ValueError, zlib.error) as error:
        reason = " ".join(str(error).split())
        raise FileFormatError(f"{path}: this is not a whole NIfTI file ({reason}).") from error
    if voxels.ndim != 3 or not np.isfinite(voxels).all():
        raise FileFormatError(f"{path}: finite HU along three axes were needed, got the shape {voxels.shape}.")
    directions = np.asarray(nifti.affine)[:3, :3]
    spacing = float(directions[0, 0])
    aligned = np.diag([spacing, spacing, directions[2, 2]])
    if not spacing > 0 or not np.allclose(directions, aligned, rtol=1e-4, atol=1e-4 * spacing):
        raise FileFormatError(f"{path}: square pixels along the patient's axes were needed, got {directions.tolist()}.")
    # The file has float32: the shortest number with the same float32 is the one that was meant.
    spacing = float(str(np.float32(spacing)))
    middle = nifti.affine[:2, 3] + (np.asarray(voxels.shape[:2]) - 1) / 2 * spacing
    center = (round(float(-middle[0]), 4) + 0.0, round(float(middle[1]), 4) + 0.0)
    image = from_hu(torch.from_numpy(voxels.transpose(2, 1, 0)[:, ::-1, ::-1].copy())).float()
    grid = ImageGrid(image.shape[1], image.shape[2], spacing, center)
    return image[0] if len(image) == 1 else image, grid
