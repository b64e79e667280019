"""What a CatSim configuration says about the raw files: geometry, rows, gain and electronic noise."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pnpct.files.catsim_cfg import Unreadable, read_cfg
from pnpct.files.errors import FileFormatError, PathLike, shown
from pnpct.files.geometry_json import read_geometry
from pnpct.files.json_file import load_json
from pnpct.geometry import ConeBeam, FanBeam, evenly_spaced_views

# What CatSim assumes where no configuration file says otherwise, for what seldom stands in one.
_DEFAULTS: dict[str, Any] = {
    "scanner.detectorCallback": "Detector_ThirdgenCurved",
    "scanner.detectionCallback": "Detection_EI",
    "scanner.detectorColsPerMod": 1,
    "scanner.detectorRowOffset": 0,
    "protocol.scanTrajectory": "Gantry_Helical",
    "protocol.startViewId": 0,
    "protocol.rotationDirection": 1,
    "protocol.startAngle": 0,
    "protocol.rotationTime": 1,
    "protocol.startZ": 0,
    "protocol.tableSpeed": 0,
    "protocol.tiltAngle": 0,
    "protocol.wobbleDistance": 0,
    "protocol.focalspotOffset": [0, 0, 0],
    "protocol.dutyRatio": 1,
    "physics.enableElectronicNoise": 1,
}
_ONLY: dict[str, Any] = {
    "scanner.detectorCallback": "Detector_ThirdgenCurved",
    "scanner.detectionCallback": "Detection_EI",
    "scanner.detectorColsPerMod": 1,
    "protocol.scanTrajectory": "Gantry_Helical",
    "protocol.tiltAngle": 0,
}


@dataclass(frozen=True)
class CatSimSettings:
    """What is needed of a configuration to understand the raw files.

    Args:
        geometry: Where the focal spot and the columns are.
        rows: Number of detector rows; 0 if it is not known.
        gain: Electrons per keV in each row, or in all of them if it is one number.
        electron_noise: Standard deviation of the electronic noise, electrons; 0 if it was switched off.
        heights: Height of the gantry in each view, mm; empty if it is not known.
        row_height: Height of a row at the detector, mm; 0 if it is not known.
        row_offset: Shift of the rows towards growing z, rows.
    """

    geometry: FanBeam
    rows: int
    gain: Sequence[float]
    electron_noise: float
    heights: Sequence[float] = ()
    row_height: float = 0.0
    row_offset: float = 0.0

    def gain_of(self, row: int) -> float:
        """Return the electrons per keV in a row."""
        return self.gain[row % len(self.gain)]

    @property
    def cone_beam(self) -> ConeBeam:
        """Where all rows are, the lowest first.

        Raises:
            FileFormatError: If the configuration does not say.
        """
        if not self.row_height:
            raise FileFormatError("All rows need scanner.detectorRowSize, which only CatSim's .cfg files have.")
        cone = self.geometry.cone_beam
        detector = replace(cone.detector, rows=self.rows, row_height=self.row_height, row_offset=self.row_offset)
        return replace(cone, trajectory=replace(cone.trajectory, z=self.heights), detector=detector)


def read_settings(configuration: PathLike | Sequence[PathLike]) -> CatSimSettings:
    """Read CatSim's configuration files, or one JSON file with the same content.

    Args:
        configuration: One or more .cfg files, later ones overriding earlier ones, or one .json file.

    Raises:
        OSError: If a file is not there or cannot be read.
        FileFormatError: If something is missing, or the scan is not an axial one with CatSim's default
            detector.
    """
    paths = (
        [configuration] if not isinstance(configuration, Sequence) or isinstance(configuration, str) else configuration
    )
    if not paths:
        raise FileFormatError("CatSim's raw files need their configuration; none was given.")
    names = " + ".join(str(path) for path in paths)
    if Path(paths[0]).suffix == ".json":
        if len(paths) > 1:
            raise FileFormatError(f"One JSON file or .cfg files say how CatSim scanned, got {names}.")
        return _from_json(paths[0])
    try:
        return _from_values(_DEFAULTS | read_cfg(paths), names)
    except FileFormatError:
        raise
    except ValueError as error:
        raise FileFormatError(f"{names}: {error}") from error


def _from_json(path: PathLike) -> CatSimSettings:
    content = load_json(path)
    numbers = [content.get(key) for key in ("gain_e_per_keV", "eNoise_e")]
    if not all(isinstance(number, int | float) and 0 <= number < 1e300 for number in numbers) or not numbers[0]:
        raise FileFormatError(
            f"{path}: CatSim's raw files need gain_e_per_keV > 0 and eNoise_e (0 if off), got {shown(numbers)}."
        )
    gain, noise = (float(number) for number in numbers if number is not None)
    return CatSimSettings(read_geometry(path).geometry, rows=0, gain=(gain,), electron_noise=noise)


def _from_values(values: dict[str, Any], names: str) -> CatSimSettings:
    for key, only in _ONLY.items():
        if values[key] != only:
            raise FileFormatError(f"{names}: {key} is {shown(values[key])}, but only scans with {only!r} can be read.")

    def number(key: str) -> float:
        return _number(values, key, names)

    rows = _whole(number("scanner.detectorRowCount"), "scanner.detectorRowCount", names)
    gain = values.get("scanner.detectionGain")
    gains = gain if isinstance(gain, list) else [number("scanner.detectionGain")]
    if len(gains) not in (1, rows) or not all(isinstance(one, int | float) and one > 0 for one in gains):
        raise FileFormatError(
            f"{names}: scanner.detectionGain must be a positive number, or one per row, got {shown(gain)}."
        )
    noise = number("scanner.eNoise") if number("physics.enableElectronicNoise") else 0.0
    return CatSimSettings(
        geometry=_geometry(values, names),
        rows=rows,
        gain=[float(one) for one in gains],
        electron_noise=noise,
        heights=_heights(values, names),
        row_height=number("scanner.detectorRowSize") if "scanner.detectorRowSize" in values else 0.0,
        row_offset=number("scanner.detectorRowOffset"),
    )


def _timing(values: dict[str, Any], names: str) -> tuple[int, int, float]:
    """Views, views a turn, and the middle of the first view, counted in views from the start of the rotation."""
    per_rotation = _whole(_number(values, "protocol.viewsPerRotation", names), "protocol.viewsPerRotation", names)
    views = _whole(_number(values, "protocol.viewCount", names), "protocol.viewCount", names)
    # A pulse shorter than the view begins with it, so that its middle comes earlier.
    early = (1 - _number(values, "protocol.dutyRatio", names)) / 2
    return views, per_rotation, int(_number(values, "protocol.startViewId", names)) - early


def _heights(values: dict[str, Any], names: str) -> list[float]:
    """Height of the gantry in each view: CatSim moves the patient."""
    views, per_rotation, first = _timing(values, names)
    start, speed = (_number(values, f"protocol.{key}", names) for key in ("startZ", "tableSpeed"))
    step = _number(values, "protocol.rotationTime", names) / per_rotation
    return [-(start + (first + view) * step * speed) for view in range(views)]


def _geometry(values: dict[str, Any], names: str) -> FanBeam:
    def number(key: str) -> float:
        return _number(values, key, names)

    direction = number("protocol.rotationDirection")
    if direction not in (1, -1):
        raise FileFormatError(f"{names}: protocol.rotationDirection must be 1 or -1, got {direction}.")
    views, per_rotation, middle = _timing(values, names)
    step = direction * 2 * math.pi / per_rotation
    start, first = math.radians(number("protocol.startAngle")) + middle * step, int(number("protocol.startViewId"))
    return FanBeam(
        view_angles=evenly_spaced_views(views, start=start, span=views * step),
        bins=_whole(number("scanner.detectorColCount"), "scanner.detectorColCount", names),
        source_to_isocenter=number("scanner.sid"),
        source_to_detector=number("scanner.sdd"),
        bin_width=number("scanner.detectorColSize"),
        detector_offset=number("scanner.detectorColOffset"),
        focal_spot_shifts=_focal_spot_shifts(values, names, range(first, first + views)),
    )


def _focal_spot_shifts(values: dict[str, Any], names: str, view_numbers: range) -> list[tuple[float, float]]:
    """The wobble goes to −x in even views and to +x in odd ones; at the first angle x is along γ, y away."""
    offset, wobble = values["protocol.focalspotOffset"], _number(values, "protocol.wobbleDistance", names)
    if not isinstance(offset, list) or len(offset) != 3 or offset[2] != 0:
        raise FileFormatError(f"{names}: protocol.focalspotOffset must be [x, y, 0] in mm, got {shown(offset)}.")
    along, away = float(offset[0]), float(offset[1])
    if not (wobble or along or away):
        return []
    return [(along + (wobble if number % 2 else -wobble), away) for number in view_numbers]


def _number(values: dict[str, Any], key: str, names: str) -> float:
    if key not in values:
        raise FileFormatError(
            f"{names}: {key} is missing; add the file that sets it, or one of CatSim's own folder cfg."
        )
    value = values[key]
    if isinstance(value, Unreadable):
        raise FileFormatError(
            f"{value}: {key} must be a plain number here, since configuration files are never executed."
        )
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise FileFormatError(f"{names}: {key} must be a number, got {shown(value)}.")
    return float(value)


def _whole(value: float, key: str, names: str) -> int:
    if value < 1 or value != int(value):
        raise FileFormatError(f"{names}: {key} must be a whole number of at least 1, got {value}.")
    return int(value)
