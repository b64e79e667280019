"""Fan beams in the words of ASTRA, ODL, TIGRE, LEAP and HelTomo (the Helsinki Tomography Challenge), in JSON.

Each becomes what ASTRA calls vectors: for every view where the source is, where the detector's centre is, and the step
from one cell to the next, with x to the right and y up. What a FanBeam cannot hold is refused: a detector that is
tilted against the fan, or that moves. Lengths are mm; lists may be names of NumPy files beside the JSON.

    ASTRA   type "fanflat": DetectorWidth, DetectorCount, ProjectionAngles (rad), DistanceOriginSource,
            DistanceOriginDetector; type "fanflat_vec": DetectorCount, Vectors (views x 6)
    ODL     src_radius, det_radius, angles (rad, the geometry's), dpart [min, max, cells]; src_to_det_init or [0, 1]
    TIGRE   DSO, DSD, nDetector and dDetector ([v, u]), angles (rad); offDetector ([v, u]) and COR, or 0
    LEAP    sod, sdd, numCols, pixelWidth, centerCol, phis (degrees); tau, or 0
    HelTomo distanceSourceOrigin, distanceSourceDetector, numDetectorsPost, pixelSizePost, angles (degrees)
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pnpct.files.array_file import load_array
from pnpct.files.errors import FileFormatError, shown
from pnpct.files.json_file import file_beside
from pnpct.geometry import FanBeam

_Values = NDArray[np.float64]
_Read = Callable[..., _Values]
HELTOMO = {"distanceSourceOrigin", "distanceSourceDetector", "numDetectorsPost", "pixelSizePost", "angles"}
"""What a HelTomo file says of the geometry, among its parameters."""

_LARGEST = 1e9  # of lengths in mm and angles, whose squares are added
_SAME = 1e-6  # of a length: what rounding leaves of an equality


def peer_geometry(content: Mapping[str, Any], folder: Path | None) -> tuple[FanBeam, bool] | None:
    """Return the geometry, and whether its bins run towards falling fan angle; None if it is in no peer's words.

    Args:
        content: The dictionary.
        folder: Where the files are that it names.

    Raises:
        FileFormatError: If keys are missing or unknown, a value has another shape, or no FanBeam has this geometry.
    """
    known = next((peer for peer in _PEERS if peer[0](content)), None)
    if known is None:
        return None
    _, name, required, optional, vectors_of = known
    missing, unknown = sorted(required - set(content)), sorted(set(content) - required - optional - {"comment"})
    if missing or unknown:
        wrong = f"needs {', '.join(missing)}" if missing else f"has no {', '.join(map(shown, unknown[:8]))}"
        raise FileFormatError(f"a fan beam of {name} {wrong}; known are {', '.join(sorted(required | optional))}.")

    def read(key: str, shape: tuple[int | None, ...] = (), default: Any = None) -> _Values:
        return _numbers(content.get(key, default), key, shape, folder)

    bins, vectors = vectors_of(read)
    if not 1 <= bins < 1e6 or bins != int(bins):
        raise FileFormatError(f"the number of cells must be a whole number of at least 1, got {bins:g}.")
    return _from_vectors(vectors, int(bins))


def _numbers(value: Any, key: str, shape: tuple[int | None, ...], folder: Path | None) -> _Values:
    if isinstance(value, str) and shape:
        value = load_array(Path(value) if folder is None else file_beside(folder, value))
    try:
        array = np.asarray(value)
    except ValueError:  # rows of unequal length
        array = np.asarray(None)
    fits = array.ndim == len(shape) and all(want in (None, got) for want, got in zip(shape, array.shape, strict=True))
    if array.dtype.kind not in "iuf" or not fits or not np.all(np.abs(array.astype(np.float64)) < _LARGEST):
        wanted = " x ".join("any" if side is None else str(side) for side in shape)
        raise FileFormatError(
            f"{key} must be {wanted if shape else 'one'} finite number(s) below {_LARGEST:g}, got {shown(value)}."
        )
    return array.astype(np.float64)


def _rotated(angles: _Values, points: list[tuple[Any, Any]]) -> _Values:
    """Vectors whose points, given at angle 0, turn counter-clockwise by the angles."""
    cos, sin = np.cos(angles), np.sin(angles)
    return np.stack([axis for x, y in points for axis in (x * cos - y * sin, x * sin + y * cos)], axis=-1)


def _astra(read: _Read) -> tuple[float, _Values]:
    points = [(0, -read("DistanceOriginSource")), (0, read("DistanceOriginDetector")), (read("DetectorWidth"), 0)]
    return float(read("DetectorCount")), _rotated(read("ProjectionAngles", (None,)), points)


def _astra_vectors(read: _Read) -> tuple[float, _Values]:
    return float(read("DetectorCount")), read("Vectors", (None, 6))


def _odl(read: _Read) -> tuple[float, _Values]:
    low, high, cells = read("dpart", (3,))
    x, y = read("src_to_det_init", (2,), [0, 1])
    turn, middle = np.arctan2(-x, y), (low + high) / 2
    angles = read("angles", (None,)) + turn
    step = (high - low) / cells if cells else 0.0
    return float(cells), _rotated(angles, [(0, -read("src_radius")), (middle, read("det_radius")), (step, 0)])


def _tigre(read: _Read) -> tuple[float, _Values]:
    (_, bins), (_, width), (_, offset) = (read(key, (2,), [0, 0]) for key in ("nDetector", "dDetector", "offDetector"))
    source, detector, shift = read("DSO"), read("DSD"), read("COR", default=0)
    points = [(source, shift), (source - detector, shift + offset), (0, width)]
    return float(bins), _rotated(read("angles", (None,)), points)


def _leap(read: _Read) -> tuple[float, _Values]:
    source, detector, width, tau = read("sod"), read("sdd"), read("pixelWidth"), read("tau", default=0)
    bins = float(read("numCols"))
    middle = ((bins - 1) / 2 - read("centerCol")) * width
    points = [(source, -tau), (source - detector, middle - tau), (0, width)]
    return bins, _rotated(np.radians(read("phis", (None,))) - np.pi / 2, points)


def _heltomo(read: _Read) -> tuple[float, _Values]:
    """As ASTRA's, to which HelTomo hands it in units of the pixels at the axis."""
    source, detector = read("distanceSourceOrigin"), read("distanceSourceDetector")
    points = [(0, -source), (0, detector - source), (read("pixelSizePost"), 0)]
    return float(read("numDetectorsPost")), _rotated(np.radians(read("angles", (None,))), points)


_PEERS: tuple[tuple[Callable[[Mapping[str, Any]], bool], str, set[str], set[str], Callable[..., Any]], ...] = (
    (
        lambda content: content.get("type") == "fanflat",
        "ASTRA",
        {"DetectorWidth", "DetectorCount", "ProjectionAngles", "DistanceOriginSource", "DistanceOriginDetector"},
        {"type"},
        _astra,
    ),
    (
        lambda content: content.get("type") == "fanflat_vec",
        "ASTRA",
        {"DetectorCount", "Vectors"},
        {"type"},
        _astra_vectors,
    ),
    (
        lambda content: "src_radius" in content,
        "ODL",
        {"src_radius", "det_radius", "angles", "dpart"},
        {"src_to_det_init"},
        _odl,
    ),
    (
        lambda content: "DSO" in content,
        "TIGRE",
        {"DSO", "DSD", "nDetector", "dDetector", "angles"},
        {"offDetector", "COR"},
        _tigre,
    ),
    (
        lambda content: "sod" in content,
        "LEAP",
        {"sod", "sdd", "numCols", "pixelWidth", "centerCol", "phis"},
        {"tau"},
        _leap,
    ),
    (lambda content: not HELTOMO.isdisjoint(set(content) - {"angles"}), "HelTomo", HELTOMO, set(), _heltomo),
)


def _from_vectors(vectors: _Values, bins: int) -> tuple[FanBeam, bool]:
    """The fan beam whose central ray stands on the detector: a source beside it is a focal spot that is shifted."""
    source, middle, step = vectors[:, :2], vectors[:, 2:4], vectors[:, 4:]
    width = np.hypot(*step.T)
    if not len(vectors) or not np.all(width > 0):
        raise FileFormatError("every view needs a step from cell to cell that is longer than 0.")
    normal = np.stack([-step[:, 1], step[:, 0]], axis=-1) / width[:, None]
    side = np.sign(np.sum(normal * (middle - source), axis=1))
    normal *= side[:, None]  # from the source to the detector: (sin β, −cos β)
    along = np.stack([-normal[:, 1], normal[:, 0]], axis=-1)  # towards growing fan angle: (cos β, sin β)
    reversed_bins = np.sum(along * step, axis=1) < 0
    radius, beyond = -np.sum(source * normal, axis=1), np.sum(middle * normal, axis=1)
    beside, offset = np.sum(source * along, axis=1), np.sum(middle * along, axis=1)
    size = float(np.max(np.abs(vectors)))
    for name, values in (
        ("width of the cells", width),
        ("direction of the cells against the source", reversed_bins.astype(np.float64) * size),
        ("distance of the detector from the axis", beyond),
        ("offset of the detector", offset),
    ):
        if np.ptp(values) > _SAME * size:
            raise FileFormatError(
                f"the {name} changes from view to view, and one fan beam has the same in all; the detector must stand "
                "across the fan and turn with the source."
            )
    nominal = float(np.mean(radius))
    shifts = np.stack([beside, radius - nominal], axis=-1)
    geometry = FanBeam(
        view_angles=np.unwrap(np.arctan2(normal[:, 0], -normal[:, 1])),
        bins=bins,
        source_to_isocenter=nominal,
        source_to_detector=nominal + float(np.mean(beyond)),
        bin_width=float(np.mean(width)),
        detector_offset=float(np.mean(offset) / np.mean(width)),
        detector="flat",
        focal_spot_shifts=[(a, b) for a, b in shifts.tolist()] if np.max(np.abs(shifts)) > _SAME * size else [],
    )
    return geometry, bool(reversed_bins[0])
