"""Voxelised phantoms of XCIST (CatSim): a description in JSON, and one raw map of volume fractions a material.

The description holds lists with one entry for each of its n_materials maps:

    mat_name                     name of the material
    volumefractionmap_filename   raw file beside the description, [slice, row, column], no header
    volumefractionmap_datatype   int8, int16, int (int32), uint (uint32), float (single) or double
    cols, rows, slices           size of the map; every material has a box of its own
    x_size, y_size, z_size       size of a voxel, mm
    x_offset, y_offset, z_offset where the isocentre is: the first voxel is number 1; columns are counted from
                                 the left, rows from the last (the bottom) upwards, slices from the lowest
    density_scale                factor for the fractions, may be left out

With n voxels of size s and the offset o along an axis, the middle of a map is at ((n + 1)/2 − o) s.
"""

import json
import math
import posixpath
import zipfile
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pnpct.files.atomic import atomic_path
from pnpct.files.errors import FileFormatError, PathLike, existing_file, shown
from pnpct.files.json_file import file_beside, parse_json
from pnpct.geometry import ImageGrid
from pnpct.geometry.short_repr import short_repr

_TYPES = {
    "int8": "<i1",
    "int16": "<i2",
    "int": "<i4",
    "int32": "<i4",
    "uint": "<u4",
    "uint32": "<u4",
    "float": "<f4",
    "single": "<f4",
    "double": "<f8",
}
_LARGEST_RATIO = 1100
_SIZES = ("cols", "rows", "slices")
_LENGTHS = ("x_size", "y_size", "z_size")
_OFFSETS = ("x_offset", "y_offset", "z_offset")
_KEYS = ("mat_name", "volumefractionmap_filename", "volumefractionmap_datatype", *_SIZES, *_LENGTHS, *_OFFSETS)

Read = Callable[[str, np.dtype[Any], int], NDArray[Any]]
"""Name, type and number of values of a raw map -> its values."""


@dataclass(frozen=True, eq=False)
class FractionMap:
    """The fraction of each voxel that one material fills; outside its voxels there is none of it.

    Args:
        material: Name of the material.
        fractions: Volume fractions, 0 to 1; slice 0 is the lowest z, row 0 the largest y, column 0 the smallest x.
        grid: Where the pixels of a slice are.
        slice_thickness: Height of a slice and distance to the next one, mm.
        center_z: z of the middle of all slices, mm.

    Raises:
        ValueError: If the fractions do not fit the grid or are not from 0 to 1, or a length is impossible.
    """

    material: str
    fractions: NDArray[Any]
    grid: ImageGrid
    slice_thickness: float
    center_z: float = 0.0

    __repr__ = short_repr

    def __post_init__(self) -> None:
        shape = self.fractions.shape
        if len(shape) != 3 or shape[0] < 1 or shape[1:] != self.grid.shape:
            raise ValueError(
                f'The fractions of "{self.material}" must have the shape (slices, rows, cols) with (rows, cols) = '
                f"{self.grid.shape}, got {shape}."
            )
        if not (math.isfinite(self.slice_thickness) and self.slice_thickness > 0 and math.isfinite(self.center_z)):
            raise ValueError(
                f'The slices of "{self.material}" need a positive thickness and a finite position in mm, got '
                f"{self.slice_thickness} and {self.center_z}."
            )
        lowest, highest = self.fractions.min(), self.fractions.max()
        if not (lowest >= 0 and highest <= 1 + 1e-4):
            raise ValueError(
                f'The volume fractions of "{self.material}" must be from 0 to 1, got {lowest:.6g} to {highest:.6g}.'
            )

    @property
    def extent(self) -> tuple[float, float]:
        """Height of the lowest slice's lower face and of the highest one's upper face, mm."""
        half = len(self.fractions) * self.slice_thickness / 2
        return self.center_z - half, self.center_z + half


def read_xcist_phantom(path: PathLike) -> tuple[FractionMap, ...]:
    """Read a voxelised phantom of XCIST.

    Maps beside a description stay on the disk (memory-mapped) unless they are scaled; those of an archive are
    read into memory, nothing is unpacked onto the disk.

    Args:
        path: The description in JSON, or a .zip archive with exactly one description and its maps.

    Returns:
        One map for each material in the file's order, with the names that the file uses.

    Raises:
        OSError: If a file is not there or cannot be read.
        FileFormatError: If the description is incomplete or contradicts the maps, a voxel is not square in x and
            y, or fractions are not from 0 to 1.
    """
    path = existing_file(path)
    try:
        if zipfile.is_zipfile(path):
            with zipfile.ZipFile(path) as archive:
                return _from_archive(archive)
        return _maps(_description(path.read_bytes()), lambda *asked: _mapped(path.parent, *asked))
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError) as error:
        raise FileFormatError(f"{path}: the archive cannot be unpacked ({error}).") from error
    except ValueError as error:
        raise FileFormatError(f"{path}: {error}") from error


def write_xcist_phantom(path: PathLike, maps: Sequence[FractionMap]) -> None:
    """Write a voxelised phantom for XCIST: the description, and a raw map in float32 for each material beside it.

    Args:
        path: File for the description, .json; the maps get its name with .density_0 and so on.
        maps: The materials, at least one, under names that CatSim knows or that are paths of its material files.

    Raises:
        OSError: If a file cannot be written.
        ValueError: If there is no map, or the name does not end in .json.
    """
    path = Path(path)
    if path.suffix.lower() != ".json":
        raise ValueError(f"The description of a phantom must have a name that ends in .json, got {path.name}.")
    if not maps:
        raise ValueError("A phantom needs the map of at least one material.")
    columns: dict[str, list[Any]] = {key: [] for key in _KEYS}
    for number, of in enumerate(maps):
        name = f"{path.stem}.density_{number}"
        with atomic_path(path.with_name(name)) as temporary:
            of.fractions.astype("<f4").tofile(temporary)
        slices, rows, cols = of.fractions.shape
        spacing, thickness = of.grid.spacing, of.slice_thickness
        entry = (of.material, name, "float", cols, rows, slices, spacing, spacing, thickness)
        axes = (
            (cols, of.grid.center[0], spacing),
            (rows, of.grid.center[1], spacing),
            (slices, of.center_z, thickness),
        )
        offsets = ((voxels + 1) / 2 - center / size for voxels, center, size in axes)
        for key, value in zip(_KEYS, (*entry, *offsets), strict=True):
            columns[key].append(value)
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps({"n_materials": len(maps), **columns}, indent=1), encoding="utf-8")


def _from_archive(archive: zipfile.ZipFile) -> tuple[FractionMap, ...]:
    # Archives made on a Mac hold shadows of all files in a folder of this name.
    names = [name for name in archive.namelist() if not name.startswith("__MACOSX/")]
    found = [name for name in names if name.lower().endswith(".json")]
    if len(found) != 1:
        raise FileFormatError(f"an archive with exactly one .json file was needed, this one has {len(found)}.")

    def read(name: str, kind: np.dtype[Any], values: int) -> NDArray[Any]:
        member = posixpath.normpath(posixpath.join(posixpath.dirname(found[0]), name))
        if member not in names:
            raise FileFormatError(f"the map {name} is not in the archive.")
        held = archive.getinfo(member)
        _check_size(name, held.file_size, kind, values)
        if held.file_size > _LARGEST_RATIO * held.compress_size + (1 << 20):
            raise FileFormatError(f"the map {name} grows more than {_LARGEST_RATIO} times; unpack the archive.")
        return np.frombuffer(archive.read(member), kind)

    return _maps(_description(archive.read(found[0])), read)


def _mapped(folder: Path, name: str, kind: np.dtype[Any], values: int) -> NDArray[Any]:
    path = file_beside(folder, name)
    if not path.is_file():
        raise FileFormatError(f"there is no map {name} beside the description.")
    _check_size(name, path.stat().st_size, kind, values)
    return np.memmap(path, kind, mode="r")


def _check_size(name: str, size: int, kind: np.dtype[Any], values: int) -> None:
    if size != values * kind.itemsize:
        raise FileFormatError(
            f"the map {name} has {size} bytes, but {values * kind.itemsize} were needed ({values} values of "
            f"{kind.itemsize} bytes); it is truncated or of another description."
        )


def _description(content: bytes) -> dict[str, list[Any]]:
    """The lists of the description, all of one length, and what is in them of the right kind."""
    entries = parse_json(content)
    if missing := [key for key in ("n_materials", *_KEYS) if key not in entries]:
        raise FileFormatError(f"missing keys: {', '.join(missing)}.")
    materials = entries["n_materials"]
    if isinstance(materials, bool) or not isinstance(materials, int) or materials < 1:
        raise FileFormatError(f"n_materials must be a whole number of at least 1, got {shown(materials)}.")
    columns = {key: entries[key] for key in _KEYS}
    if "density_scale" in entries:
        columns["density_scale"] = entries["density_scale"]
    for key, values in columns.items():
        if not isinstance(values, list) or len(values) != materials:
            raise FileFormatError(f"{key} must be a list with one entry for each of the {materials} materials.")
        for value in values:
            _check_entry(key, value)
    return {"density_scale": [1.0] * materials, **columns}


def _check_entry(key: str, value: Any) -> None:
    if key in ("mat_name", "volumefractionmap_filename"):
        good, needed = isinstance(value, str) and value != "", "a name"
    elif key == "volumefractionmap_datatype":
        good, needed = isinstance(value, str) and value in _TYPES, f"one of {', '.join(_TYPES)}"
    else:
        good = isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e9
        needed = "a finite number"
        if key in _SIZES:
            good, needed = good and value >= 1 and value == int(value), "a whole number of at least 1"
        elif key not in _OFFSETS:
            good, needed = good and value > 0, "a positive number"
    if not good:
        raise FileFormatError(f"{key} must hold {needed}, got {shown(value)}.")


def _maps(columns: dict[str, list[Any]], read: Read) -> tuple[FractionMap, ...]:
    entries = [dict(zip(columns, values, strict=True)) for values in zip(*columns.values(), strict=True)]
    return tuple(_map(entry, read) for entry in entries)


def _map(entry: dict[str, Any], read: Read) -> FractionMap:
    if not math.isclose(entry["x_size"], entry["y_size"], rel_tol=1e-6):
        raise FileFormatError(
            f'pixels must be square, those of "{entry["mat_name"]}" have {entry["x_size"]} mm in x and '
            f"{entry['y_size']} mm in y."
        )
    cols, rows, slices = (int(entry[key]) for key in _SIZES)
    kind = np.dtype(_TYPES[entry["volumefractionmap_datatype"]])
    fractions = read(entry["volumefractionmap_filename"], kind, cols * rows * slices)
    if entry["density_scale"] != 1:
        fractions = fractions * np.float32(entry["density_scale"])
    axes = zip((cols, rows, slices), _OFFSETS, _LENGTHS, strict=True)
    x, y, z = (((voxels + 1) / 2 - entry[offset]) * entry[size] for voxels, offset, size in axes)
    return FractionMap(
        material=entry["mat_name"],
        fractions=fractions.reshape(slices, rows, cols),
        grid=ImageGrid(rows, cols, spacing=float(entry["x_size"]), center=(float(x), float(y))),
        slice_thickness=float(entry["z_size"]),
        center_z=float(z),
    )
