"""Geometries in pnpct's HDF5 files: of a fan beam, or with detector_rows among the attributes of a cone beam."""

from collections.abc import Sequence
from typing import Literal

import h5py
import numpy as np
from numpy.typing import NDArray

from pnpct.files.errors import FileFormatError, shown
from pnpct.files.hdf5 import number_of, read_array, text_of, whole_number_of
from pnpct.geometry import ConeBeam, Detector, FanBeam, Geometry, Trajectory

_LENGTHS = {"source_to_isocenter_mm": "source_to_isocenter", "source_to_detector_mm": "source_to_detector"}
_KINDS: dict[str, Literal["arc", "flat"]] = {"arc": "arc", "flat": "flat"}
_ANGLES = "the focal spot is at (-R sin, R cos) of this angle: at the top for 0, counter-clockwise with growth"
_HEIGHTS = "height of the nominal focal spot and of the middle of the detector in each view, towards the head"
_SHIFTS = "shift of the focal spot in each view: towards growing fan angle, away from the isocentre"


def write_geometry_group(group: h5py.Group, geometry: Geometry) -> None:
    """Store a geometry in a group."""
    cone = geometry.cone_beam if isinstance(geometry, FanBeam) else geometry
    trajectory, detector = cone.trajectory, cone.detector
    group.attrs.update({key: getattr(cone, name) for key, name in _LENGTHS.items()})
    group.attrs.update(bin_width_mm=detector.bin_width, detector_offset_bins=detector.offset)
    group.attrs.update(detector=detector.kind, bins=detector.bins)
    _write(group, "view_angles", trajectory.angles, units="rad", description=_ANGLES)
    shifts = np.asarray(trajectory.focal_spot_shifts).reshape(-1, 3)
    if isinstance(geometry, FanBeam):
        _write(group, "focal_spot_shifts", shifts[:, :2], units="mm", description=_SHIFTS)
        return
    group.attrs.update(detector_rows=detector.rows, row_height_mm=detector.row_height)
    group.attrs.update(row_offset_rows=detector.row_offset)
    _write(group, "z", trajectory.z, units="mm", description=_HEIGHTS)
    _write(group, "focal_spot_shifts", shifts, units="mm", description=f"{_SHIFTS}, towards growing z")


def _write(group: h5py.Group, name: str, values: Sequence[float] | NDArray[np.float64], **attributes: str) -> None:
    """Store numbers, if there are any."""
    if len(values):
        group.create_dataset(name, data=np.asarray(values)).attrs.update(attributes)


def read_geometry_group(group: h5py.Group, views: slice = slice(None)) -> Geometry:
    """Load what `write_geometry_group` stored.

    Args:
        group: The group.
        views: Which views to load.

    Raises:
        FileFormatError: If something is missing or does not fit together.
    """
    angles = read_array(group, "view_angles").numpy()
    of_rows = "detector_rows" in group.attrs
    z, shifts = _optional(group, "z", (0,)), _optional(group, "focal_spot_shifts", (0, 3 if of_rows else 2))
    if angles.ndim != 1 or z.ndim != 1 or shifts.ndim != 2 or shifts.shape[1:] != (3 if of_rows else 2,):
        raise FileFormatError(
            f"view angles must have the shape (views,), their heights as well, and focal-spot shifts (views, "
            f"{3 if of_rows else 2}), got {angles.shape}, {z.shape} and {shifts.shape}."
        )
    if angles.size and not angles[views].size:
        first, last = views.start or 0, (views.stop or angles.size) - 1
        raise FileFormatError(f"none of the views {first} to {last} is among its {angles.size} views.")
    geometry = ConeBeam(
        Trajectory(
            angles[views], z[views], [(along, away, *up, 0.0)[:3] for along, away, *up in shifts[views].tolist()]
        ),
        Detector(
            bins=whole_number_of(group, "bins"),
            bin_width=number_of(group, "bin_width_mm"),
            offset=number_of(group, "detector_offset_bins"),
            kind=_kind(group),
            rows=whole_number_of(group, "detector_rows") if of_rows else 1,
            row_height=number_of(group, "row_height_mm") if of_rows else 0.0,
            row_offset=number_of(group, "row_offset_rows") if of_rows else 0.0,
        ),
        **{name: number_of(group, key) for key, name in _LENGTHS.items()},
    )
    return geometry if of_rows else FanBeam.from_cone_beam(geometry)


def _kind(group: h5py.Group) -> Literal["arc", "flat"]:
    kind = text_of(group, "detector")
    if kind not in _KINDS:
        raise FileFormatError(f'the detector is "arc" or "flat", got {shown(kind)}.')
    return _KINDS[kind]


def _optional(group: h5py.Group, name: str, shape: tuple[int, ...]) -> NDArray[np.float64]:
    return read_array(group, name).numpy() if name in group else np.zeros(shape)
