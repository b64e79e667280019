"""Scans from the raw files that CatSim (gecatsim 1.5 and 1.6) leaves behind.

PREFIX.scan, PREFIX.air and PREFIX.offset hold electrons, PREFIX.prep line integrals: float32, little endian,
[view, row, column], no header. The detector integrates energy: a photon of E keV gives E · gain electrons.
One quantum is counted here as `kev_per_quantum` · gain electrons. It should be ⟨E²⟩/⟨E⟩ of the spectrum
detected without an object, which makes the variance of air its mean: 69 keV in the middle and 81 keV under
the edge of the large bow-tie filter at 120 kVp (behind a chest ⟨E²⟩/⟨E⟩ is 74 to 86 keV). It scales counts,
incident quanta and electronic noise alike and leaves the line integrals as they are.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pnpct.files.catsim_settings import CatSimSettings, read_settings
from pnpct.files.errors import FileFormatError, PathLike, existing_file
from pnpct.files.importers import as_float32, correction_of
from pnpct.files.measured_rays import counts_of
from pnpct.geometry import Geometry
from pnpct.physics import Scan
from pnpct.units import MU_WATER_70_KEV

Electrons = NDArray[np.float64]


def scan_from_catsim(
    prefix: PathLike,
    *,
    configuration: PathLike | Sequence[PathLike],
    signal: Literal["raw", "prep"] = "raw",
    detector_row: int | None = None,
    all_rows: bool = False,
    kev_per_quantum: float = 70.0,
    incident: float | None = None,
    mu_water: float = MU_WATER_70_KEV,
    beam_hardening: PathLike | None = None,
) -> Scan:
    """Read a scan of CatSim: one detector row of an axial scan, or all rows of an axial or helical one.

    Only the row in the middle plane is a true fan; rows beside it are read as if they were, unless all rows are.
    Scans with tilt, flat modules of several columns, a flat panel or photon counting are refused.

    Args:
        prefix: CatSim's `resultsName`: the path of the raw files without their suffix.
        configuration: CatSim's configuration files (later ones override earlier ones, values that a script
            has changed belong in one more file), or one JSON file with the CatSim keys of
            `pnpct.files.geometry_json`, gain_e_per_keV and eNoise_e.
        signal: "raw" takes .scan, .air and, if it is there, .offset; "prep" takes the line integrals of
            .prep, that CatSim has corrected for low signals (and smoothed there), and .air for the incident
            quanta.
        detector_row: Index of the row, the lowest is 0; None takes the middle one.
        all_rows: Whether to read all rows, as a cone beam.
        kev_per_quantum: Energy that counts as one quantum, keV.
        incident: Quanta per ray without an object, instead of those of the air scan.
        mu_water: Attenuation of water at the scan's effective energy, 1/mm.
        beam_hardening: NumPy file of coefficients (columns, order + 1), highest power first.

    Returns:
        The scan, in quanta, float32.

    Raises:
        OSError: If a file is not there or cannot be read.
        FileFormatError: If a file is incomplete, or the configuration not complete or not one of those above.
        ValueError: If a number is out of range.
    """
    if not (math.isfinite(kev_per_quantum) and kev_per_quantum > 0):
        raise ValueError(f"kev_per_quantum must be a positive energy in keV, got {kev_per_quantum}.")
    settings = read_settings(configuration)
    shape = settings.geometry.shape
    main = Path(f"{prefix}.{'scan' if signal == 'raw' else 'prep'}")
    count = settings.rows or existing_file(main).stat().st_size // (4 * shape[0] * shape[1])
    if count < 1:
        raise FileFormatError(f"{main} is truncated: it does not even hold one row of {shape[0]} x {shape[1]} values.")
    rows = range(count) if all_rows else [_chosen_row(main, detector_row, count, settings)]
    if all_rows and detector_row is not None:
        raise ValueError(f"Either all rows are read or row {detector_row}; leave out one of them.")
    geometry: Geometry = replace(settings, rows=count).cone_beam if all_rows else settings.geometry
    per_quantum = np.array([[settings.gain_of(row)] for row in rows]) * kev_per_quantum
    values, offset = _raw_rows(main, shape, rows, count), _offset(prefix, shape, rows, count)
    if incident is None:
        quanta = (_air(prefix, shape, rows, count) - offset) / per_quantum
    else:
        quanta = np.asarray(float(incident))
    raw = signal == "raw"
    counts = (values - offset) / per_quantum if raw else counts_of(values, quanta, name=str(main))
    if not all_rows:
        counts, quanta = counts[:, 0], quanta[..., 0, :] if quanta.ndim else quanta
    return Scan(
        counts=as_float32(counts),
        incident=as_float32(quanta),
        electronic_noise=float(np.mean(settings.electron_noise / per_quantum)),
        geometry=geometry,
        mu_water=mu_water,
        beam_hardening=correction_of(beam_hardening),
    )


def _chosen_row(main: Path, detector_row: int | None, count: int, settings: CatSimSettings) -> int:
    """Index of the one row to read."""
    if len({round(height, 6) for height in settings.heights}) > 1:
        raise FileFormatError(
            f"{main} is of a table that moves (protocol.tableSpeed); read all of its rows (--all-rows)."
        )
    row = count // 2 if detector_row is None else detector_row
    if not 0 <= row < count:
        raise ValueError(f"The detector has the rows 0 to {count - 1}, but row {row} was asked for.")
    return row


def _air(prefix: PathLike, shape: tuple[int, int], rows: Sequence[int], count: int) -> Electrons:
    """One air view for each view of the scan, or the mean of however many there are."""
    air = _raw_rows(Path(f"{prefix}.air"), (None, shape[1]), rows, count)
    return air if len(air) == shape[0] else np.asarray(air.mean(axis=0))


def _offset(prefix: PathLike, shape: tuple[int, int], rows: Sequence[int], count: int) -> Electrons:
    """What the detector reads without radiation; zero where there is no such scan, as CatSim's always is."""
    path = Path(f"{prefix}.offset")
    if not path.exists():
        return np.zeros(shape[1])
    return np.asarray(_raw_rows(path, (None, shape[1]), rows, count).mean(axis=0))


def _raw_rows(path: Path, shape: tuple[int | None, int], rows: Sequence[int], count: int) -> Electrons:
    """Rows of a raw file as (views, rows, columns); the number of views follows from the size if it is None."""
    views, bins = shape
    size = existing_file(path).stat().st_size
    view_size = 4 * count * bins
    needed = view_size * (views if views is not None else max(1, size // view_size))
    if size != needed:
        wanted = f"a multiple of {view_size}" if views is None else f"{views} times {view_size}"
        raise FileFormatError(
            f"{path} has {size} bytes, but {wanted} was needed ({count} rows x {bins} columns a view); "
            "it is truncated or of another configuration."
        )
    values = np.fromfile(path, dtype="<f4").reshape(-1, count, bins)[:, rows]
    if not np.isfinite(values).all():
        where = f"row {rows[0]}" if len(rows) == 1 else f"the rows {rows[0]} to {rows[-1]}"
        raise FileFormatError(
            f"{path} holds {int((~np.isfinite(values)).sum())} values that are not finite in {where}."
        )
    return values.astype(np.float64)  # a NaN that signals would warn here
