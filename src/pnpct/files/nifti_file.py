"""NIfTI files: HU, the object lying as a patient does on the back, head first, seen from the feet.

Our x grows towards the patient's left, our y towards the front. Viewers in the radiological convention then show the
picture as it is here. The voxels are stored in the order that NIfTI calls RAS+ (first axis towards the patient's right,
second towards the front, third towards the head), so with x reversed. A volume is a NIfTI file of three dimensions; an
image, which has no height, is one of two.
"""

import gzip
import math
import warnings
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import nibabel as nib
import numpy as np
import torch
from nibabel.filebasedimages import ImageFileError
from nibabel.spatialimages import HeaderDataError
from numpy.typing import NDArray

from pnpct.arrays import Image, Volume
from pnpct.files.atomic import atomic_path
from pnpct.files.errors import FileFormatError, PathLike, existing_file
from pnpct.files.plausible import check_foreign_image
from pnpct.files.provenance import Provenance
from pnpct.geometry import Grid, ImageGrid, VolumeGrid
from pnpct.units import from_hu

_MOST_VOXELS = 1 << 36
"""Of a file that is not damaged: 64 billion."""

_IN_MM = {"meter": 1e3, "micron": 1e-3}
"""Units of lengths that a file may have instead of mm."""


def write_nifti(path: PathLike, image_hu: NDArray[np.float64], grid: Grid, provenance: Provenance) -> None:
    """Write an image or a volume, compressed if the name ends in .gz.

    Args:
        path: File to write, .nii or .nii.gz; an existing one is replaced.
        image_hu: HU (slices, rows, columns), of one slice for an image.
        grid: Where the pixels are.
        provenance: How it was made.

    Raises:
        OSError: If the file cannot be written.
    """
    nifti = _nifti(image_hu.astype(np.float32), grid)
    nifti.header["descrip"] = f"pnpct {provenance.version}, HU".encode()[:79]
    nifti.header.extensions.append(nib.nifti1.Nifti1Extension("comment", provenance.to_json().encode()))
    content = nifti.to_bytes()
    with atomic_path(path) as temporary:
        temporary.write_bytes(gzip.compress(content, mtime=0) if Path(path).suffix.lower() == ".gz" else content)


def packed_nifti(image_hu: NDArray[np.float64], grid: Grid) -> bytes:
    """Return an image or a volume as a small .nii.gz to look at: HU in whole numbers, as far as 16 bits hold them.

    Args:
        image_hu: HU (slices, rows, columns), of one slice for an image.
        grid: Where the pixels are.
    """
    whole = np.rint(image_hu).clip(-32768, 32767).astype(np.int16)
    return gzip.compress(_nifti(whole, grid).to_bytes(), mtime=0)


def _nifti(image_hu: NDArray[Any], grid: Grid) -> Any:
    # From (slice, row, column) to RAS+: the last column is the patient's left, the last row the back.
    voxels = image_hu[:, ::-1, ::-1].transpose(2, 1, 0)
    plane = grid.plane if isinstance(grid, VolumeGrid) else grid
    affine = np.diag([plane.spacing, plane.spacing, 1.0, 1.0])
    affine[:2, 3] = -plane.x[-1], plane.y[-1]
    if isinstance(grid, VolumeGrid):
        affine[2, 2:] = grid.slice_spacing, grid.heights[0]
    new: Any = nib.Nifti1Image  # nibabel has no types here
    nifti = new(voxels if isinstance(grid, VolumeGrid) else voxels[..., 0], affine)
    nifti.set_sform(affine, code="scanner")
    nifti.set_qform(affine, code="scanner")
    nifti.header.set_xyzt_units(xyz="mm")
    return nifti


def read_nifti(path: PathLike) -> tuple[Image | Volume, Grid]:
    """Read an image or a volume relative to water, and its grid.

    Raises:
        OSError: If there is no such file or it cannot be read.
        FileFormatError: If the content is incomplete or not an image in HU along the patient's axes.
    """
    existing_file(path)
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"), _silent_nibabel():
            warnings.simplefilter("ignore")  # what does not fit is refused below
            voxels, affine, axes, own = _canonical(path)
    except MemoryError as error:
        raise FileFormatError(f"{path} declares more voxels than the memory holds; is it damaged?") from error
    except (ImageFileError, HeaderDataError, ArithmeticError, EOFError, OSError, ValueError, zlib.error) as error:
        reason = " ".join(str(error).split())
        raise FileFormatError(f"{path}: this is not a complete NIfTI file ({reason}).") from error
    if voxels.ndim != 3 or not voxels.size or not np.isfinite(voxels).all():
        raise FileFormatError(f"{path}: finite HU along two or three axes were needed, got the shape {voxels.shape}.")
    directions = affine[:3, :3]
    spacing, slice_spacing = float(directions[0, 0]), float(directions[2, 2])
    aligned = np.diag([spacing, spacing, slice_spacing])
    off_axis = not np.allclose(directions, aligned, rtol=1e-4, atol=1e-4 * spacing)
    if not min(spacing, slice_spacing) > 0 or off_axis or (axes == 2 and voxels.shape[2] != 1):
        raise FileFormatError(f"{path}: square pixels along the patient's axes were needed, got {directions.tolist()}.")
    low, high = float(voxels.min()), float(voxels.max())
    # The file has float32: the shortest number with the same float32 is the one that was meant.
    spacing, slice_spacing = float(str(np.float32(spacing))), float(str(np.float32(slice_spacing)))
    middle = affine[:3, 3] + (np.asarray(voxels.shape) - 1) / 2 * [spacing, spacing, slice_spacing]
    right, front, head = (round(float(position), 4) + 0.0 for position in middle)
    image = from_hu(torch.from_numpy(voxels.transpose(2, 1, 0)[:, ::-1, ::-1].copy())).float()
    slices, rows, cols = image.shape
    plane = ImageGrid(rows, cols, spacing, (0.0 - right, front))
    check_foreign_image(path, low, high, plane, own=own)
    return (image[0], plane) if axes == 2 else (image, VolumeGrid(plane, slices, slice_spacing, head))


@contextmanager
def _silent_nibabel() -> Iterator[None]:
    """Keep nibabel from reporting to stderr what it mends; its own way leaves it without a handler for good."""
    logger: Any = nib.imageglobals.logger
    before, logger.disabled = logger.disabled, True
    try:
        yield
    finally:
        logger.disabled = before


def _canonical(path: PathLike) -> tuple[NDArray[np.float64], NDArray[np.float64], int, bool]:
    """Read voxels in the order RAS+, their affine, how many axes the file has for them, and whether it is pnpct's.

    More axes than three, where they are not of one time, come as they are, and axes that have no direction too.
    """
    nib_: Any = nib  # which has no types here
    nifti = nib_.load(path)
    if math.prod(nifti.shape) > _MOST_VOXELS:
        raise MemoryError
    voxels, affine = np.asarray(nifti.dataobj, dtype=np.float64), np.array(nifti.affine, dtype=np.float64)
    affine[:3] *= _IN_MM.get(_unit(nifti.header), 1.0)
    own = bytes(np.asarray(nifti.header.get("descrip", b"")).item()).startswith(b"pnpct")
    if voxels.ndim < 2 or max(voxels.shape[3:], default=1) > 1:
        return voxels, affine, voxels.ndim, own
    axes, voxels = min(voxels.ndim, 3), voxels.reshape((*voxels.shape, 1)[:3])
    if axes == 2:
        affine[:3, 2] = np.cross(affine[:3, 0], affine[:3, 1])  # whatever the header says of an axis that is not there
    if np.isnan(nib_.io_orientation(affine)).any():  # an axis that leads nowhere
        return voxels, affine, axes, own
    turned = nib_.as_closest_canonical(nib_.Nifti1Image(voxels, affine))
    return np.asarray(turned.dataobj), np.asarray(turned.affine), axes, own


def _unit(header: Any) -> str:
    try:
        return str(header.get_xyzt_units()[0])
    except KeyError as error:
        raise ValueError("its distances have a unit of no known code") from error
