"""Fan-beam geometries written by hand, in JSON.

The schema (lengths in mm; what has a default may be left out; a "comment" may be added):

    source_to_isocenter_mm      distance from the focal spot to the axis of rotation
    source_to_detector_mm       distance from the focal spot to the detector
    bins                        number of detector cells
    bin_width_mm                width of a cell at the detector
    detector                    "arc" (default, centred on the focal spot) or "flat"
    detector_offset_bins        shift of the cells towards growing fan angle, default 0
    bin_direction               1 (default): the array's bins run towards growing fan angle; -1: they run the
                                other way and are reversed on reading (only the arrays are: offset and
                                shifts are always counted towards growing fan angle)
    focal_spot_shifts_mm        per view [towards growing fan angle, away from the isocentre]; default none

The view angles, in one of three ways, and what they mean:

    view_angles_deg             a list, or the name of a NumPy file beside the JSON: "scan.npz:angles"
    view_angles_rad             the same in rad
    views, start_deg, span_deg  number of even steps; start_deg is 0 and span_deg 360 by default
    source_at_zero_angle        where the focal spot is at angle 0, x to the right and y up: "+y" (default),
                                "+x", "-y" or "-x"
    rotation_direction          1 (default): counter-clockwise with growing angle; -1: clockwise

With the focal spot at the top the fan angle grows to the right, and that turns with the focal spot: at the
position β (top 0, counter-clockwise) it grows towards (cos β, sin β).

The keys of a CatSim scan (sid_mm, sdd_mm, n_cols, col_pitch_mm, col_offset_cols, n_views, views_per_rotation,
start_angle_deg, rotation_direction) are understood as well; other keys beside them are notes. So are the fan beams of
ASTRA, ODL, TIGRE, LEAP and HelTomo, in the keys that `pnpct.files.peer_geometries` lists; HelTomo's are found
in its .mat files too.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pnpct.files.array_file import load_array
from pnpct.files.errors import FileFormatError, PathLike, shown
from pnpct.files.json_file import file_beside, load_json
from pnpct.files.mat_file import mat_scan_parameters
from pnpct.files.peer_geometries import HELTOMO, peer_geometry
from pnpct.geometry import FanBeam, evenly_spaced_views

_REQUIRED = {"source_to_isocenter_mm", "source_to_detector_mm", "bins", "bin_width_mm"}
_ANGLES = ("view_angles_deg", "view_angles_rad", "views")
_OPTIONAL = {
    *("detector", "detector_offset_bins", "bin_direction", "focal_spot_shifts_mm", "comment"),
    *(*_ANGLES, "start_deg", "span_deg", "source_at_zero_angle", "rotation_direction"),
}
_LONGEST_KEY, _MOST_KEYS = 40, 8
_QUARTER_TURNS = {"+y": 0, "-x": 1, "-y": 2, "+x": -1}
_CATSIM = {
    *("sid_mm", "sdd_mm", "n_cols", "col_pitch_mm", "col_offset_cols"),
    *("n_views", "views_per_rotation", "start_angle_deg", "rotation_direction"),
}


@dataclass(frozen=True)
class WrittenGeometry:
    """A geometry and the order in which an array runs through it.

    Args:
        geometry: The geometry in our conventions.
        bins_reversed: Whether the array's bins run towards falling fan angle and have to be reversed.
    """

    geometry: FanBeam
    bins_reversed: bool = False


def read_geometry(source: PathLike | Mapping[str, Any]) -> WrittenGeometry:
    """Read a geometry from a JSON file or what it would hold, or from a .mat file of HelTomo.

    Args:
        source: The file, or its content.

    Raises:
        OSError: If there is no such file or it cannot be read.
        FileFormatError: If it is not JSON or MATLAB, keys are missing or unknown, or values do not fit together.

    Example:
        >>> keys = dict(source_to_isocenter_mm=541, source_to_detector_mm=949, bins=900, bin_width_mm=1.0239)
        >>> read_geometry({**keys, "views": 984, "detector_offset_bins": 0.25}).geometry.shape
        (984, 900)
    """
    folder: Path | None = None
    if isinstance(source, Mapping):
        content, name = dict(source), "The geometry"
    else:
        name, path = str(source), Path(source)
        content = mat_scan_parameters(path, HELTOMO) if path.suffix == ".mat" else load_json(path)
        folder = path.parent
    try:
        peer = peer_geometry(content, folder)
        if peer is not None:
            return WrittenGeometry(*peer)
        return _from_catsim_keys(content) if "sid_mm" in content else _from_our_keys(content, folder)
    except FileFormatError as error:
        raise FileFormatError(f"{name}: {error}") from error
    except ValueError as error:
        raise FileFormatError(f"{name}: {error}") from error


def _from_our_keys(content: dict[str, Any], folder: Path | None) -> WrittenGeometry:
    _check_keys(content, required=_REQUIRED, known=_REQUIRED | _OPTIONAL)
    zero = _choice(content, "source_at_zero_angle", tuple(_QUARTER_TURNS), "+y")
    direction = _choice(content, "rotation_direction", (1, -1), 1)
    angles = [_QUARTER_TURNS[zero] * math.pi / 2 + direction * angle for angle in _view_angles(content, folder)]
    shifts = content.get("focal_spot_shifts_mm", [])
    if not isinstance(shifts, list) or not all(isinstance(shift, list) and len(shift) == 2 for shift in shifts):
        raise FileFormatError("focal_spot_shifts_mm must be a list with [along, away] for each view.")
    geometry = FanBeam(
        view_angles=angles,
        bins=_whole_number(content, "bins"),
        source_to_isocenter=_number(content, "source_to_isocenter_mm"),
        source_to_detector=_number(content, "source_to_detector_mm"),
        bin_width=_number(content, "bin_width_mm"),
        detector_offset=_number(content, "detector_offset_bins", 0.0),
        detector=_choice(content, "detector", ("arc", "flat"), "arc"),
        focal_spot_shifts=[(_real(along, "a shift"), _real(away, "a shift")) for along, away in shifts],
    )
    return WrittenGeometry(geometry, bins_reversed=_choice(content, "bin_direction", (1, -1), 1) == -1)


def _view_angles(content: dict[str, Any], folder: Path | None) -> list[float]:
    """The view angles as they are written, rad."""
    given = [key for key in _ANGLES if key in content]
    if len(given) != 1:
        raise FileFormatError(f"one of {', '.join(_ANGLES)} is needed, got {' and '.join(given) or 'none'}.")
    key = given[0]
    unused = [name for name in ("start_deg", "span_deg") if name in content]
    if key == "views":
        start, span = _number(content, "start_deg", 0.0), _number(content, "span_deg", 360.0)
        views = _whole_number(content, "views")
        return list(evenly_spaced_views(views, start=math.radians(start), span=math.radians(span)))
    if unused:
        raise FileFormatError(f"{' and '.join(unused)} go with views, not with {key}; leave out one of them.")
    values = content[key]
    if isinstance(values, str):
        array = load_array(Path(values) if folder is None else file_beside(folder, values))
        if array.ndim != 1:
            raise FileFormatError(f"{key} must be a list of angles, got an array of shape {array.shape}.")
        values = array.astype(np.float64).tolist()
    if not isinstance(values, list):
        raise FileFormatError(f"{key} must be a list of angles or the name of a file, got {shown(values)}.")
    angles = [_real(value, key) for value in values]
    return [math.radians(angle) for angle in angles] if key.endswith("deg") else angles


def _from_catsim_keys(content: dict[str, Any]) -> WrittenGeometry:
    _check_keys(content, required=_CATSIM, known=set(content))
    shape = content.get("detector", "arc")
    if not isinstance(shape, str) or not shape.startswith(("arc", "equi-angular")):
        raise FileFormatError(f"the detector of a CatSim scan must be an equi-angular arc, got {shown(shape)}.")
    step = 360.0 / _whole_number(content, "views_per_rotation")
    turn = _choice(content, "rotation_direction", (1, -1), 1) * step * _whole_number(content, "n_views")
    start = math.radians(_number(content, "start_angle_deg"))
    return WrittenGeometry(
        FanBeam(
            view_angles=evenly_spaced_views(_whole_number(content, "n_views"), start=start, span=math.radians(turn)),
            bins=_whole_number(content, "n_cols"),
            source_to_isocenter=_number(content, "sid_mm"),
            source_to_detector=_number(content, "sdd_mm"),
            bin_width=_number(content, "col_pitch_mm"),
            detector_offset=_number(content, "col_offset_cols"),
        )
    )


def _check_keys(content: dict[str, Any], *, required: set[str], known: set[str]) -> None:
    missing, unknown = sorted(required - set(content)), sorted(set(content) - known)
    if unknown:
        raise FileFormatError(f"unknown keys: {_listed(unknown)}; known are {', '.join(sorted(known))}.")
    if missing:
        raise FileFormatError(f"missing keys: {', '.join(missing)}; add them.")


def _listed(keys: list[str]) -> str:
    named = ", ".join(key if len(key) <= _LONGEST_KEY else shown(key) for key in keys[:_MOST_KEYS])
    return named + (f" and {len(keys) - _MOST_KEYS} more" if len(keys) > _MOST_KEYS else "")


def _real(value: Any, name: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < 1e300:
        raise FileFormatError(f"{name} must be a finite number, got {shown(value)}.")
    return float(value)


def _number(content: dict[str, Any], key: str, default: float | None = None) -> float:
    return _real(content[key] if default is None or key in content else default, key)


def _whole_number(content: dict[str, Any], key: str) -> int:
    value = _number(content, key)
    if value < 1 or value != int(value):
        raise FileFormatError(f"{key} must be a whole number of at least 1, got {shown(content[key])}.")
    return int(value)


def _choice(content: dict[str, Any], key: str, choices: tuple[Any, ...], default: Any) -> Any:
    value = content.get(key, default)
    if isinstance(value, bool) or value not in choices:
        raise FileFormatError(f"{key} must be one of {', '.join(map(str, choices))}, got {shown(value)}.")
    return value
