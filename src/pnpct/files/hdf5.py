"""What all pnpct's HDF5 files share: how they are made, opened, checked and described."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import h5py
import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from pnpct.arrays import Image, Volume
from pnpct.files.atomic import atomic_path
from pnpct.files.errors import FileFormatError, PathLike, existing_file, shown
from pnpct.files.growing_file import GrowingFile
from pnpct.files.provenance import Provenance
from pnpct.files.self_contained import check_heaps, check_self_contained, check_stored
from pnpct.geometry import Grid, ImageGrid, VolumeGrid

FORMAT_VERSION = 1
# What h5py raises for content that is not what it seems.
_DAMAGE = (ArithmeticError, AttributeError, KeyError, OSError, RuntimeError, SystemError, TypeError, ValueError)
_PLANE = {"spacing_mm": "spacing", "rows": "rows", "cols": "cols"}
_STACK = {"slices": "slices", "slice_spacing_mm": "slice_spacing", "z_mm": "z"}
_CHUNK_BYTES = 1 << 18


@contextmanager
def new_hdf5(
    path: PathLike, *, file_format: str, provenance: Provenance | Callable[[], Provenance], description: str
) -> Iterator[h5py.File]:
    """Give an HDF5 file to fill, and write it to `path` when the block has succeeded.

    It grows on the disk, under another name until then; the memory needed is that of what is stored at a time.

    Args:
        path: File to write.
        file_format: What the file is, such as "pnpct-scan".
        provenance: How the content was made; or a function that says so when the block has succeeded.
        description: What a reader should know of the content, in words.

    Yields:
        The open file, with its root attributes already there.

    Raises:
        OSError: If the file cannot be written.
    """
    with atomic_path(path) as temporary, GrowingFile(temporary) as disk, h5py.File(disk, "w") as file:
        file.attrs.update(format=file_format, format_version=FORMAT_VERSION, description=description)
        yield file
        known = provenance if isinstance(provenance, Provenance) else provenance()
        file.attrs["provenance"] = known.to_json()


@contextmanager
def open_hdf5(path: PathLike, *, formats: Sequence[str]) -> Iterator[h5py.File]:
    """Open one of pnpct's HDF5 files for reading; whatever is wrong with its content becomes one sentence.

    Args:
        path: The file.
        formats: The accepted formats; all of them if it is empty.

    Yields:
        The open file.

    Raises:
        OSError: If there is no such file or it cannot be read.
        FileFormatError: If the content is incomplete, of another format or newer version, or leads to another file.
    """
    with opened_hdf5(path) as file:
        _check_format(file, formats)
        yield file


@contextmanager
def opened_hdf5(path: PathLike) -> Iterator[h5py.File]:
    """Open an HDF5 file of any program for reading, as `open_hdf5` does one of pnpct's.

    Raises:
        OSError: If there is no such file or it cannot be read.
        FileFormatError: If the content is incomplete or leads to another file.
    """
    path = existing_file(path)
    with path.open("rb"):
        pass  # the system's own error for what cannot be read, before HDF5's
    try:
        check_heaps(path)
        with h5py.File(path, "r") as file:
            check_self_contained(file)
            yield file
    except FileFormatError as error:
        raise FileFormatError(f"{path}: {error}") from error
    except _DAMAGE as error:
        raise FileFormatError(f"{path}: {_what_is_wrong(error)}") from error


def _check_format(file: h5py.File, formats: Sequence[str]) -> None:
    found, number = file.attrs.get("format"), file.attrs.get("format_version")
    if not isinstance(found, str) or not isinstance(number, np.integer):
        raise FileFormatError("an HDF5 file, but not one of pnpct's (no root attributes format and format_version).")
    if formats and found not in formats:
        needed = " or ".join(formats)
        raise FileFormatError(f'a file of the format "{found}" was given where "{needed}" was needed; choose another.')
    if number > FORMAT_VERSION:
        raise FileFormatError(
            f"its format version {number} is newer than the {FORMAT_VERSION} known here; update pnpct."
        )


def _what_is_wrong(error: Exception) -> str:
    text = " ".join(str(error.args[0] if isinstance(error, KeyError) and error.args else error).split())
    if "signature not found" in text:
        return "this is not an HDF5 file; give a file that pnpct has written."
    if isinstance(error, BlockingIOError):
        return "this file is being written by another program; wait until that is done."
    if "truncated file" in text or "eof" in text.lower():
        return "this file is truncated; copy it again or create it again."
    if isinstance(error, KeyError):
        return f"something is missing in this file ({text}); create it again."
    if not isinstance(error, ValueError) or isinstance(error, UnicodeError):
        return f"this file is damaged ({text}); copy it again or create it again."
    return text


def write_array(group: h5py.Group, name: str, values: Tensor, *, units: str, description: str) -> h5py.Dataset:
    """Store an array as float32 with its unit, compressed in blocks of whole rows."""
    dataset = new_array(group, name, tuple(values.shape), units=units, description=description)
    dataset[()] = values.detach().cpu().numpy().astype(np.float32)
    return dataset


def new_array(group: h5py.Group, name: str, shape: tuple[int, ...], *, units: str, description: str) -> h5py.Dataset:
    """Make room for an array of float32, as `write_array` does, to be filled in parts."""
    options: dict[str, Any] = {}
    if len(shape) >= 2 and all(shape):
        left, chunks = _CHUNK_BYTES // 4, list[int]()
        for length in reversed(shape):
            chunks.insert(0, max(1, min(length, left)) if chunks else length)
            left //= chunks[0]
        options = {"chunks": tuple(chunks), "compression": "gzip", "compression_opts": 1, "shuffle": True}
    dataset = group.create_dataset(name, shape, np.float32, **options)
    dataset.attrs.update(units=units, description=description)
    return dataset


def read_array(group: h5py.Group, name: str, part: tuple[Any, ...] = ()) -> Float[Tensor, "..."]:
    """Load a dataset of finite numbers, or a part of it.

    Args:
        group: Where it is.
        name: Its name.
        part: Which part, as h5py indexes it.

    Raises:
        FileFormatError: If it is missing or empty, holds something else, or declares more than the file can hold.
    """
    dataset = group.get(name)
    if not isinstance(dataset, h5py.Dataset):
        raise FileFormatError(f"the dataset {group.name.rstrip('/')}/{name} is missing in this file; create it again.")
    if dataset.dtype.kind not in "fiu":
        raise FileFormatError(f"{dataset.name} must hold numbers, but it holds {dataset.dtype}.")
    if dataset.shape is None or not dataset.size:
        raise FileFormatError(f"{dataset.name} is empty; create the file again.")
    check_stored(dataset)
    values = torch.from_numpy(np.asarray(dataset[part]))
    values = values if values.is_floating_point() else values.double()
    if not values.isfinite().all():
        raise FileFormatError(f"{dataset.name} holds values that are not finite; create the file again.")
    return values


def numbers_of(item: h5py.Group | h5py.Dataset, name: str, count: int) -> list[float]:
    """Return an attribute of so many finite numbers.

    Raises:
        FileFormatError: If it is missing or something else.
    """
    values = np.asarray(_attribute(item, name))
    if values.dtype.kind not in "fiu" or values.size != count or not np.isfinite(values).all():
        needed = "a finite number" if count == 1 else f"{count} finite numbers"
        raise FileFormatError(f"the attribute {name} of {item.name} must be {needed}, got {shown(values.tolist())}.")
    return [float(value) for value in values.ravel()]


def number_of(item: h5py.Group | h5py.Dataset, name: str) -> float:
    """Return an attribute that is one finite number, as `numbers_of` does."""
    return numbers_of(item, name, 1)[0]


def whole_number_of(item: h5py.Group | h5py.Dataset, name: str) -> int:
    """Return an attribute that is a whole number, as `numbers_of` does."""
    number = number_of(item, name)
    if not number.is_integer():
        raise FileFormatError(f"the attribute {name} of {item.name} must be a whole number, got {number:g}.")
    return int(number)


def text_of(item: h5py.Group | h5py.Dataset, name: str) -> str:
    """Return an attribute that is text.

    Raises:
        FileFormatError: If it is missing or something else.
    """
    text = _attribute(item, name)
    if not isinstance(text, str):
        raise FileFormatError(f"the attribute {name} of {item.name} must be text, got {shown(text)}.")
    return text


def _attribute(item: h5py.Group | h5py.Dataset, name: str) -> Any:
    if name not in item.attrs:
        raise FileFormatError(f"the attribute {name} of {item.name} is missing in this file; create it again.")
    return item.attrs[name]


def group_of(file: h5py.Group, name: str) -> h5py.Group:
    """Return a group of a file or of a group.

    Raises:
        FileFormatError: If it is missing.
    """
    group = file.get(name)
    if not isinstance(group, h5py.Group):
        raise FileFormatError(f"the group {file.name.rstrip('/')}/{name} is missing in this file; create it again.")
    return group


def write_image_dataset(group: h5py.Group, image: Image | Volume, grid: Grid, *, description: str) -> None:
    """Store an image or a volume as `image` in a group, with its grid as attributes."""
    if tuple(image.shape[image.ndim - len(grid.shape) :]) != grid.shape:
        raise ValueError(f"The image must end in the grid's {grid.shape}, got {tuple(image.shape)}.")
    units = "attenuation relative to water (air 0, water 1; HU = 1000 (image - 1))"
    dataset = write_array(group, "image", image, units=units, description=description)
    plane = grid.plane if isinstance(grid, VolumeGrid) else grid
    dataset.attrs.update({key: getattr(plane, name) for key, name in _PLANE.items()})
    dataset.attrs["center_xy_mm"] = plane.center
    dataset.attrs["orientation"] = "row 0 is the largest y, column 0 the smallest x; x to the right, y up"
    if isinstance(grid, VolumeGrid):
        dataset.attrs.update({key: getattr(grid, name) for key, name in _STACK.items()})
        dataset.attrs["orientation"] += "; slice 0 the smallest z; z towards the head"


def read_image_dataset(group: h5py.Group) -> tuple[Image | Volume, Grid]:
    """Load what `write_image_dataset` stored; it is a volume if the number of slices is among the attributes.

    Raises:
        FileFormatError: If something is missing or does not fit together.
    """
    image = read_array(group, "image")
    x, y = numbers_of(group["image"], "center_xy_mm", 2)
    rows, cols = whole_number_of(group["image"], "rows"), whole_number_of(group["image"], "cols")
    plane = ImageGrid(rows, cols, number_of(group["image"], "spacing_mm"), (x, y))
    grid: Grid = plane
    if "slices" in group["image"].attrs:
        between, z = number_of(group["image"], "slice_spacing_mm"), number_of(group["image"], "z_mm")
        grid = VolumeGrid(plane, whole_number_of(group["image"], "slices"), between, z)
    if tuple(image.shape[image.ndim - len(grid.shape) :]) != grid.shape:
        raise FileFormatError(f"the image has the shape {tuple(image.shape)}, but its grid {grid.shape}.")
    return image, grid


def describe_file(path: PathLike) -> dict[str, Any]:
    """Describe what one of pnpct's HDF5 files holds, without loading its arrays.

    Returns:
        Plain values: "format", "format_version", "description", "provenance" (as a dictionary), "arrays"
        (shape, type, units and description by name) and "attributes" (all others, by the name of what they
        belong to).

    Raises:
        OSError: If there is no such file or it cannot be read.
        FileFormatError: If it is not one of pnpct's HDF5 files.
    """
    arrays: dict[str, dict[str, Any]] = {}
    attributes: dict[str, dict[str, Any]] = {}

    def visit(name: str, item: h5py.Group | h5py.Dataset) -> None:
        plain = {key: value.tolist() if hasattr(value, "tolist") else value for key, value in item.attrs.items()}
        if isinstance(item, h5py.Dataset):
            arrays[name] = {"shape": item.shape or (), "type": str(item.dtype)}
            arrays[name] |= {key: plain.pop(key, "") for key in ("units", "description")}
        if plain:
            attributes[name] = plain

    with open_hdf5(path, formats=()) as file:
        visit("/", file)
        file.visititems(visit)
        description = text_of(file, "description")
        provenance = vars(Provenance.from_json(text_of(file, "provenance")))
    root = attributes.pop("/")
    known = {"format": root["format"], "format_version": root["format_version"], "description": description}
    for name in (*known, "provenance"):
        del root[name]
    if root:
        attributes["/"] = root
    return {**known, "provenance": provenance, "arrays": arrays, "attributes": attributes}
