"""The header of one view in DICOM-CT-PD: where its rays are."""

import math
from dataclasses import dataclass
from pathlib import Path

from pydicom.uid import ExplicitVRLittleEndian, ImplicitVRLittleEndian

from pnpct.files.ct_pd.elements import Elements, read_elements
from pnpct.files.errors import FileFormatError, shown

_PER_MM = 0.1
"""No water attenuates more per mm, and none less per cm, at the energies of CT."""

_FARTHEST_TURN = 0.1
"""rad; the focal spot moves by less, and one that seems to move farther has its shifts in mm."""

_FLAGS = ("BeamHardening", "Gain", "DarkField", "FlatField", "BadPixel", "Scatter")


@dataclass(frozen=True, slots=True)
class Layout:
    """What all views of a series share.

    Args:
        columns: Number of detector columns.
        rows: Number of detector rows.
        column_width: Length of a column on the arc of the detector, mm.
        row_height: Height of a row at the detector, mm.
        central_column: Column of the central ray, counted from 1 and in fractions, as the manual counts them.
        central_row: Row of the central ray, likewise.
        radius: Distance from the focal centre of the detector to the axis, mm.
        distance: Distance from there to the detector, mm.
        by_columns: Whether the pixels are stored column by column.
        mu_water: Attenuation of water, 1/mm; 0 if it is not stated.
        tube_voltage_kvp: Tube voltage, kVp; 0 if it is not stated.
        spectrum: Number of the spectrum; 1 if it is not stated.
        uncorrected: What the line integrals are not corrected for, in the words of the flags.
    """

    columns: int
    rows: int
    column_width: float
    row_height: float
    central_column: float
    central_row: float
    radius: float
    distance: float
    by_columns: bool
    mu_water: float
    tube_voltage_kvp: float
    spectrum: int
    uncorrected: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class View:
    """Where the rays of one view are.

    Args:
        path: Its file.
        series: SeriesInstanceUID.
        number: InstanceNumber, by which views are ordered.
        angle: φ of the focal centre of the detector, rad; as it is stored, it jumps by 2π somewhere in each turn.
        z: Its height, mm.
        shift: What the focal spot adds to φ, to z and to the distance from the axis: rad, mm, mm.
        tube_current_ma: mA; 0 if it is not stated.
        layout: What it shares with the others.
    """

    path: Path
    series: str
    number: int
    angle: float
    z: float
    shift: tuple[float, float, float]
    tube_current_ma: float
    layout: Layout


def read_view(path: Path) -> View | None:
    """Read the header of a view.

    Args:
        path: The file.

    Returns:
        The header; None if the file is not in DICOM, or holds something else.

    Raises:
        OSError: If the file cannot be read.
        FileFormatError: If it is damaged, incomplete, or of a kind that is not read.
    """
    header = read_elements(path)
    if header is None or not header.numbers("DetectorElementTransverseSpacing").size:
        return None
    _check_kind(header)
    return View(
        path=path,
        series=header.text("SeriesInstanceUID"),
        number=header.whole_number("InstanceNumber"),
        angle=header.number("DetectorFocalCenterAngularPosition"),
        z=header.number("DetectorFocalCenterAxialPosition"),
        shift=_shift(header),
        tube_current_ma=header.number_or("XRayTubeCurrent", 0.0),
        layout=_layout(header),
    )


def _layout(header: Elements) -> Layout:
    columns, rows = (header.whole_number(f"NumberofDetector{name}") for name in ("Columns", "Rows"))
    stored = header.whole_number("Rows"), header.whole_number("Columns")
    if stored not in ((columns, rows), (rows, columns)):
        raise FileFormatError(
            f"{header.path} holds {stored[0]} x {stored[1]} pixels, but its detector has {columns} columns and {rows} "
            "rows; the file is damaged."
        )
    central = header.numbers("DetectorCentralElement")
    if central.size != 2:
        raise FileFormatError(f"{header.path}: DetectorCentralElement must be two numbers, got {central.size}.")
    column, row = central.tolist()
    # GE counts the columns from the other end and from 0, as both halves of a turn show, which must see the same.
    counted_back = header.text("Manufacturer").upper().startswith("GE")
    return Layout(
        columns=columns,
        rows=rows,
        column_width=header.number("DetectorElementTransverseSpacing"),
        row_height=header.number("DetectorElementAxialSpacing"),
        central_column=columns - column if counted_back else column,
        central_row=row,
        radius=header.number("DetectorFocalCenterRadialDistance"),
        distance=header.number("ConstantRadialDistance"),
        by_columns=stored == (columns, rows),
        mu_water=_mu_water(header),
        tube_voltage_kvp=header.number_or("KVP", 0.0),
        spectrum=int(header.number_or("SpectrumIndex", 1)),
        uncorrected=tuple(name for name in _FLAGS if header.text(f"{name}CorrectionFlag").upper() == "NO"),
    )


def _check_kind(header: Elements) -> None:
    """Check that the file is one of those that are read."""
    syntax = header.dataset.file_meta.get("TransferSyntaxUID", ImplicitVRLittleEndian)
    if syntax not in (ImplicitVRLittleEndian, ExplicitVRLittleEndian):
        raise FileFormatError(
            f"{header.path} is written in {shown(syntax.name)}; convert the series to Explicit VR Little Endian first."
        )
    if header.number_or("NumberOfFrames", 1) != 1:
        raise FileFormatError(f"{header.path} holds several views; only files of one view each are read.")
    if header.number_or("BitsAllocated", 16) != 16 or header.number_or("PixelRepresentation", 0) != 0:
        raise FileFormatError(f"{header.path}: pixels of 16 bits without a sign are needed.")
    shape = header.text("DetectorShape").upper()
    if shape != "CYLINDRICAL":
        raise FileFormatError(f"{header.path}: a CYLINDRICAL detector is needed, got {shown(shape)}.")
    if header.text("LogFlag").upper() == "NO":
        raise FileFormatError(f"{header.path} holds intensities (LogFlag NO), but line integrals are needed.")


def _mu_water(header: Elements) -> float:
    """The attenuation of water; files have it in 1/mm or in 1/cm, and do not say which."""
    name = "WaterAttenuationCoefficient" if _is_v10(header) else "HUCalibrationFactor"
    mu = header.number_or(name, 0.0)
    return mu / 10 if mu > _PER_MM else mu


def _is_v10(header: Elements) -> bool:
    """Whether the dictionary is the tenth version: the eighth has the attenuation of water under another tag."""
    return bool(header.numbers("WaterAttenuationCoefficient").size) or not header.numbers("HUCalibrationFactor").size


def _shift(header: Elements) -> tuple[float, float, float]:
    turn, up = (header.number_or(f"Source{name}PositionShift", 0.0) for name in ("Angular", "Axial"))
    if not _is_v10(header):
        turn, up = up, turn  # the eighth version has their tags the other way round
    if math.fabs(turn) > _FARTHEST_TURN:
        raise FileFormatError(
            f"{header.path}: the focal spot turns by {turn:g} rad (SourceAngularPositionShift), which none does."
        )
    return turn, up, header.number_or("SourceRadialDistanceShift", 0.0)
