"""Arrays in MATLAB files, up to version 7 and of version 7.3, which is HDF5."""

import struct
import warnings
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat
from scipy.io.matlab import MatReadError

from pnpct.files.errors import FileFormatError, PathLike, existing_file
from pnpct.files.hdf5 import opened_hdf5
from pnpct.files.self_contained import check_stored

# What scipy raises for files that are cut, damaged or of another kind.
_DAMAGE = (
    *(ArithmeticError, AttributeError, EOFError, LookupError, NotImplementedError, OSError, RuntimeError),
    *(TypeError, ValueError, MatReadError, struct.error, zlib.error),
)
_TEXT = b"char"


def mat_arrays(path: PathLike) -> dict[str, NDArray[Any]]:
    """Load all arrays of numbers in a MATLAB file, with the shapes that MATLAB shows.

    Fields of structures are named as in MATLAB, "CtData.parameters.angles". Texts, cells, sparse matrices and arrays of
    structures are left out.

    Raises:
        OSError: If there is no such file or it cannot be read.
        FileFormatError: If it is not a complete MATLAB file.
    """
    path = existing_file(path)
    with path.open("rb"):
        pass  # the system's own error for what cannot be read
    if h5py.is_hdf5(path):
        with opened_hdf5(path) as file:
            return dict(_in_group("", file))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            content = loadmat(path, appendmat=False)
        return {name: array for key, value in content.items() for name, array in _in_structure(key, value)}
    except _DAMAGE as error:
        raise FileFormatError(f"{path}: this is not a complete MATLAB file; save it again, by save -v7.") from error


def mat_scan_parameters(path: Path, keys: set[str]) -> dict[str, Any]:
    """Return those of the keys that the structure "parameters" of a scan has: numbers, and lists for vectors.

    Raises:
        OSError: If there is no such file or it cannot be read.
        FileFormatError: If it is not a complete MATLAB file, or none of the keys is in it.
    """
    found = {
        name.rpartition(".")[2]: array.ravel().tolist()
        for name, array in mat_arrays(path).items()
        if name.rpartition(".")[2] in keys and ".parameters." in f".{name}"
    }
    if not found:
        raise FileFormatError(
            f"{path}: no structure in it has parameters of a scan ({', '.join(sorted(keys))}); write the geometry "
            "as JSON."
        )
    return {key: values if len(values) != 1 or key == "angles" else values[0] for key, values in found.items()}


def _in_structure(name: str, value: Any) -> Iterator[tuple[str, NDArray[Any]]]:
    if not isinstance(value, np.ndarray) or name.startswith("__"):
        return
    if value.dtype.names and value.size == 1:
        for field in value.dtype.names:
            yield from _in_structure(f"{name}.{field}", value.ravel()[0][field])
    elif value.dtype.kind in "fiub":
        yield name, value


def _in_group(name: str, group: h5py.Group) -> Iterator[tuple[str, NDArray[Any]]]:
    for key in group:
        item = group.get(key)
        if isinstance(item, h5py.Group) and not key.startswith("#") and item != group:
            yield from _in_group(f"{name}{key}.", item)
        elif isinstance(item, h5py.Dataset) and item.dtype.kind in "fiub":
            check_stored(item)
            if not np.array_equal(item.attrs.get("MATLAB_class", b""), _TEXT):
                yield name + key, np.asarray(item[()]).T
