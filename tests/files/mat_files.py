"""MATLAB files as HelTomo writes them, of both kinds."""

from collections.abc import Mapping
from pathlib import Path

import h5py
import numpy as np
from scipy.io import savemat

Parameters = Mapping[str, object]


def of_version_5(path: Path, sinogram: np.ndarray, parameters: Parameters) -> None:
    scan = {"type": "2D", "sinogram": sinogram, "parameters": dict(parameters)}
    savemat(path, {"CtDataLimited": scan}, do_compression=True)


def of_version_7_3(path: Path, sinogram: np.ndarray, parameters: Parameters) -> None:
    """As MATLAB lays it out: a block before, groups for structures, arrays transposed, texts as numbers."""
    with h5py.File(path, "w", userblock_size=512) as file:
        scan = file.create_group("CtDataLimited")
        scan.attrs["MATLAB_class"] = np.bytes_("struct")
        scan["sinogram"] = sinogram.T
        for name, value in parameters.items():
            text = isinstance(value, str)
            data = np.array([list(value.encode())], np.uint16) if text else np.atleast_2d(value).astype(float)
            scan.create_dataset(f"parameters/{name}", data=data.T)
            scan[f"parameters/{name}"].attrs["MATLAB_class"] = np.bytes_("char" if text else "double")
        file.create_group("#refs#")["a"] = np.ones((9, 9))
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file".ljust(512, b"\0"))
