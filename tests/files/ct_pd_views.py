"""A small writer of DICOM-CT-PD: the exact line integrals of a ball, by the coordinates of the format's manual."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from pydicom.dataset import Dataset, FileDataset, FileMetaDataset
from pydicom.uid import UID, ExplicitVRLittleEndian, ImplicitVRLittleEndian

from pnpct.geometry import ConeBeam, Detector, Trajectory
from pnpct.physics import Scan

COLUMNS, ROWS, VIEWS = 24, 8, 12
WIDTH, HEIGHT = 18.0, 6.0
RADIUS, DISTANCE = 595.0, 1085.6
CENTRAL_COLUMN, CENTRAL_ROW = 13.375, 4.25
MU_WATER = 0.0192
BALL, BALL_RADIUS = np.array([22.0, -31.0, 3.5]), 40.0
STEP, OFFSET = 2.0**-13, -0.2
PHOTONS = 1e4 * (1 + np.arange(COLUMNS))


def chords(source: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Length of the rays within the ball, mm."""
    along = cells - source
    along = along / np.linalg.norm(along, axis=-1, keepdims=True)
    to_middle = BALL - source
    nearest = (to_middle * along).sum(-1)
    away = (to_middle**2).sum(-1) - nearest**2
    return 2 * np.sqrt(np.clip(BALL_RADIUS**2 - away, 0.0, None))


def angle_of(view: int) -> float:
    """φ of a view, rad; it jumps after the second."""
    return (2.9 + 0.1 * view + math.pi) % (2 * math.pi) - math.pi


def shift_of(view: int, mode: str) -> tuple[float, float, float]:
    """Of the focal spot: rad, mm, mm."""
    turn = (0.0007 if view % 2 else -0.0007) if "XY" in mode else 3.4e-4
    out = ("Z" in mode) * (view // 2 % 2 if "XY" in mode else view % 2)
    return turn, -0.66 * out, 5.45 * out


def line_integrals(view: int, mode: str, feed: float) -> np.ndarray:
    """Of the ball: (columns, rows), column 1 and row 1 first."""
    phi, z, (turn, up, out) = angle_of(view), feed * view, shift_of(view, mode)
    radius, angle = RADIUS + out, phi + turn
    source = np.array([-radius * math.sin(angle), radius * math.cos(angle), z + up])
    gamma = (np.arange(1, COLUMNS + 1) - CENTRAL_COLUMN) * WIDTH / DISTANCE
    cells = np.empty((COLUMNS, ROWS, 3))
    cells[..., 0] = (-RADIUS * math.sin(phi) + DISTANCE * np.sin(phi + gamma))[:, None]
    cells[..., 1] = (RADIUS * math.cos(phi) - DISTANCE * np.cos(phi + gamma))[:, None]
    cells[..., 2] = z - (np.arange(1, ROWS + 1) - CENTRAL_ROW) * HEIGHT
    return MU_WATER * chords(source, cells)


def native_scan(views: int, mode: str, feed: float) -> Scan:
    """The scan of which `write_folder` writes the views."""
    step = WIDTH / DISTANCE
    width = 2 * DISTANCE * math.tan(step / 2)
    offset = math.tan(((COLUMNS + 1) / 2 - CENTRAL_COLUMN) * step) * DISTANCE / width
    turn, up, out = np.array([shift_of(view, mode) for view in range(views)]).T
    across, away = -(RADIUS + out) * np.sin(turn), (RADIUS + out) * np.cos(turn) - RADIUS
    detector = Detector(COLUMNS, width, offset, rows=ROWS, row_height=HEIGHT, row_offset=CENTRAL_ROW - (ROWS + 1) / 2)
    numbers = np.arange(views)
    shifts = list(zip(across.tolist(), away.tolist(), up.tolist(), strict=True))
    trajectory = Trajectory(2.9 + 0.1 * numbers, feed * numbers, shifts)
    values = np.stack([line_integrals(view, mode, feed).T[::-1] for view in range(views)])
    counts = torch.from_numpy(1e6 * np.exp(-values)).float()
    return Scan(counts, torch.tensor(1e6), 0.0, ConeBeam(trajectory, detector, RADIUS, DISTANCE), MU_WATER)


def write_folder(
    folder: Path,
    *,
    views: int = VIEWS,
    mode: str = "FFSNONE",
    feed: float = 0.3,
    version: int = 10,
    vendor: str = "SIEMENS",
    by_columns: bool = True,
    explicit: bool = False,
    early: bool = False,
    scale_per_view: bool = False,
    change: Callable[[FileDataset, int], object] = lambda view, number: None,
) -> Path:
    """Write the views, under names in another order, and return the folder."""
    folder.mkdir()
    syntax = ExplicitVRLittleEndian if explicit else ImplicitVRLittleEndian
    for view in range(views):
        values = line_integrals(view, mode, feed)
        step = STEP * (1 + 0.1 * view) if scale_per_view else STEP
        stored = np.rint((values - OFFSET) / float(f"{step:.10g}")).astype("<u2")
        dataset = _header(view, stored if by_columns else stored.T, step, syntax)
        _private(dataset, view, mode, feed, version=8 if early else version, vendor=vendor, early=early)
        change(dataset, view)
        dataset.save_as(folder / f"{(7 * view) % views:03d}.{view}.dcm", enforce_file_format=True)
    return folder


def _header(view: int, stored: np.ndarray, step: float, syntax: UID) -> FileDataset:
    meta = FileMetaDataset()
    meta.MediaStorageSOPClassUID = UID("1.2.840.10008.5.1.4.1.1.66")
    meta.MediaStorageSOPInstanceUID, meta.TransferSyntaxUID = UID(f"2.25.{view + 1}"), syntax
    dataset = FileDataset("", {}, file_meta=meta, preamble=b"\0" * 128)
    dataset.SOPClassUID, dataset.SOPInstanceUID = meta.MediaStorageSOPClassUID, meta.MediaStorageSOPInstanceUID
    dataset.StudyInstanceUID, dataset.SeriesInstanceUID = "2.25.1000", "2.25.2000"
    dataset.PatientName, dataset.PatientID, dataset.PatientPosition = "Ball", "B1", "HFS"
    dataset.Modality, dataset.KVP, dataset.InstanceNumber = "CT", 120, 501 + view
    dataset.XRayTubeCurrent = 100 + 10 * view
    dataset.Rows, dataset.Columns = stored.shape
    dataset.BitsAllocated, dataset.BitsStored, dataset.HighBit, dataset.PixelRepresentation = 16, 16, 15, 0
    dataset.SmallestImagePixelValue, dataset.LargestImagePixelValue = int(stored.min()), int(stored.max())
    dataset.RescaleSlope, dataset.RescaleIntercept = f"{step:.10g}", f"{OFFSET:.10g}"
    dataset.PixelData = np.ascontiguousarray(stored).tobytes()
    dataset["PixelData"].VR = "OW"
    return dataset


def _private(dataset: Dataset, view: int, mode: str, feed: float, *, version: int, vendor: str, early: bool) -> None:
    turn, up, out = shift_of(view, mode)
    dataset.Manufacturer = vendor
    central = COLUMNS - CENTRAL_COLUMN if vendor.startswith("GE") else CENTRAL_COLUMN
    if version == 8:
        dataset.add_new(0x00180061, "DS", f"{MU_WATER * (10 if early else 1):g}")
    for tag, vr, value in (
        (0x70291002, "FL", WIDTH),
        (0x70291006, "FL", HEIGHT),
        (0x7029100B, "CS", "CYLINDRICAL"),
        (0x70291010, "US", ROWS),
        (0x70291011, "US", COLUMNS),
        (0x70311001, "FL", angle_of(view)),
        (0x70311002, "FL", feed * view),
        (0x70311003, "FL", RADIUS),
        (0x70311031, "FL", DISTANCE),
        (0x70311033, "FL", [central, CENTRAL_ROW]),
        (0x7033100B, "FL", up if version == 8 else turn),
        (0x7033100C, "FL", turn if version == 8 else up),
        (0x7033100D, "FL", out),
        (0x7033100E, "CS", mode),
        (0x70331063, "US", 1),
        (0x70331065, "FL", (PHOTONS * (1 + view)).tolist()),
        (0x70391008, "CS", "NO"),
        (0x70391009, "CS", "YES"),
        (0x70411001, "DS", f"{MU_WATER:g}"),
    ):
        if not (early and tag == 0x70331065) and not (version == 8 and tag == 0x70411001):
            dataset.add_new(tag, vr, value)
    for group in (0x7029, 0x7031, 0x7033, 0x7039, 0x7041):
        dataset.add_new((group, 0x0010), "LO", "CT IMG ACQUISITION" if early else f"Module{group:04x}")
