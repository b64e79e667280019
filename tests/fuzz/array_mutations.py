"""Seeded damage to arrays in files of NumPy and MATLAB, and in raw ones."""

import random
import zipfile
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from mutations import of_bytes, of_hdf5, places
from scipy.io import loadmat, savemat


def of_npz(path: Path, chance: random.Random) -> str:
    """Change a member of a .npz file, or the only array of a .npy file."""
    if path.suffix == ".npy":
        np.save(path, odd_array(np.load(path), chance), allow_pickle=True)
        return "another array"
    arrays = dict(np.load(path))
    name = chance.choice(list(arrays))
    how = chance.choice(("array", "array", "array", "remove", "foreign", "empty archive"))
    if how == "array":
        arrays[name] = odd_array(arrays[name], chance)
    elif how != "foreign":
        arrays = {} if how == "empty archive" else {other: each for other, each in arrays.items() if other != name}
    np.savez(path, **arrays)
    if how == "foreign":
        with zipfile.ZipFile(path, "a") as archive:
            archive.writestr(chance.choice(("notes.txt", "x.npy", "../x.npy")), b"words")
    return f"{how} {name}"


def of_mat(path: Path, chance: random.Random) -> str:
    """Change an array in a MATLAB file of either kind."""
    if h5py.is_hdf5(path):
        return of_hdf5(path, chance)
    content = {name: each for name, each in loadmat(path, simplify_cells=True).items() if not name.startswith("__")}
    where, key = chance.choice(list(places(content)))
    value = where.pop(key)
    how = chance.choice(("array", "array", "array", "remove", "rename", "structure", "cell"))
    if how == "array":
        where[key] = odd_array(np.atleast_2d(0.0 if isinstance(value, str | dict) else value), chance)
    elif how != "remove":
        other = {"a": value} if how == "structure" else np.array([value, "x"], dtype=object) if how == "cell" else value
        where[key + "x" if how == "rename" else key] = other
    try:
        savemat(path, content)
    except (TypeError, ValueError):  # scipy does not write everything
        return of_bytes(path, chance)
    return f"{how} {key}"


def odd_array(array: np.ndarray, chance: random.Random) -> Any:
    """Another array in the place of one."""
    flat = np.asarray(array, float)
    return chance.choice(
        (
            *(np.full(flat.shape, value) for value in (np.nan, np.inf, 0.0, -1.0, 1e300, 1e-300, 1e5)),
            *(
                flat.T,
                flat[None],
                flat.ravel(),
                np.zeros((0, *flat.shape[1:])),
                flat.astype(complex),
                flat > 0,
                flat.astype("<U8"),
                flat * 1e6,
            ),
            np.array(["a", None], dtype=object),
        )
    )


def of_raw(path: Path, chance: random.Random) -> str:
    """Put odd numbers in a raw file."""
    values = np.fromfile(path, "<f4")
    odd = odd_array(values, chance)
    np.asarray(odd if odd.dtype.kind == "f" else values, "<f4").tofile(path)
    return "other numbers"
