"""Geometries in our HDF5 files."""

import h5py
import numpy as np
import torch

from pnpct.files.errors import FileFormatError
from pnpct.files.hdf5 import read_array
from pnpct.geometry import FanBeam

_LENGTHS = {
    "source_to_isocenter_mm": "source_to_isocenter",
    "source_to_detector_mm": "source_to_detector",
    "bin_width_mm": "bin_width",
    "detector_offset_bins": "detector_offset",
}


def write_geometry_group(group: h5py.Group, geometry: FanBeam) -> None:
    """Store a geometry in a group."""
    group.attrs.update({key: getattr(geometry, name) for key, name in _LENGTHS.items()})
    group.attrs.update(detector=geometry.detector, bins=geometry.bins)
    angles = group.create_dataset("view_angles", data=np.asarray(geometry.view_angles))
    meaning = "the focal spot is at (-R sin, R cos) of this angle: at the top for 0, counter-clockwise with growth"
    angles.attrs.update(units="rad", description=meaning)
    if geometry.focal_spot_shifts:
        shifts = group.create_dataset("focal_spot_shifts", data=np.asarray(geometry.focal_spot_shifts))
        meaning = "shift of the focal spot in each view: towards growing fan angle, away from the isocentre"
        shifts.attrs.update(units="mm", description=meaning)


def read_geometry_group(group: h5py.Group) -> FanBeam:
    """Load what `write_geometry_group` stored.

    Raises:
        FileFormatError: If something is missing or does not fit together.
    """
    shifts = read_array(group, "focal_spot_shifts") if "focal_spot_shifts" in group else torch.zeros(0, 2)
    angles = read_array(group, "view_angles")
    if angles.ndim != 1 or shifts.ndim != 2 or shifts.shape[1] != 2:
        raise FileFormatError(
            f"view angles must have the shape (views,) and focal-spot shifts (views, 2), got "
            f"{tuple(angles.shape)} and {tuple(shifts.shape)}."
        )
    return FanBeam(
        view_angles=angles.tolist(),
        bins=int(group.attrs["bins"]),
        detector=group.attrs["detector"],
        focal_spot_shifts=[(along, away) for along, away in shifts.tolist()],
        **{name: float(group.attrs[key]) for key, name in _LENGTHS.items()},
    )
