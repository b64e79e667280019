"""`pnpct import dicom-ct-pd`: from clinical projection data to a scan."""

import hashlib
import math
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional

from pnpct.cli.artefact import SCANS, check_output, finish
from pnpct.cli.parsing import option
from pnpct.cli.terminal import say, track
from pnpct.files import (
    VIEWS_OF_A_SLAB,
    CTPDSeries,
    Provenance,
    patient_and_study,
    projection_files,
    read_scan,
    read_slabs,
    read_views,
    record_run,
    series_of,
    write_scan_slabs,
)
from pnpct.geometry import Coverage
from pnpct.physics import Scan, column_shift, half_turn_views

_AGREEMENT = 0.4
"""Columns; an image is sharp with half of it, and vendors who count otherwise are off by one and more."""


@dataclass(frozen=True)
class ImportDicomCtPd:
    """Make a scan from a folder of clinical projection data in DICOM-CT-PD, one view in each file.

    The headers of all files are read first, then the pixels, of which only a few views are in memory at a time.

    Args:
        folder: Folder with the files of one series.
        scan: File for the scan, .h5.
        incident: Quanta per ray in air at the mean tube current; each view is scaled by its own tube current.
        electronic_noise: Standard deviation of the electronic noise per count, quanta; the files do not state it.
        mu_water: Attenuation coefficient of water at the effective energy, 1/mm.
        central_column: Detector column of the central ray, counted from 1 in the order of the pixels.
    """

    folder: Positional[Path]
    scan: Positional[Path]
    incident: Annotated[float | None, option(default="PhotonStatistics of the files")] = None
    electronic_noise: float = 0.0
    mu_water: Annotated[float | None, option(default="that of the files")] = None
    central_column: Annotated[float | None, option(default="that of the files")] = None

    def run(self, command: Sequence[str]) -> None:
        """Read, and write the scan."""
        check_output(self.scan, SCANS)
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", module="pydicom")  # of values that are against the standard
            self._import(command)

    def _import(self, command: Sequence[str]) -> None:
        files = projection_files(self.folder)
        views = [view for view in track(read_views(files), total=len(files), of="headers") if view is not None]
        series = replace(series_of(self.folder, views), central_column=self.central_column)
        source, fingerprint = patient_and_study(series.views[0]), hashlib.sha256()

        def scans() -> Iterator[Scan]:
            slabs = read_slabs(
                series, incident=self.incident, electronic_noise=self.electronic_noise, mu_water=self.mu_water
            )
            for slab in track(slabs, total=math.ceil(len(series.views) / VIEWS_OF_A_SLAB), of="slabs of views"):
                fingerprint.update(slab.sha256)
                yield slab.scan

        def provenance() -> Provenance:
            # One fingerprint for the folder: that of those of its files in the order of the views.
            recorded = record_run(command, settings={"dicom": source})
            return replace(recorded, inputs={str(self.folder): fingerprint.hexdigest()})

        description = self._description(series, source)
        write_scan_slabs(self.scan, series.geometry, scans(), provenance=provenance, description=description)
        finish(self.scan, provenance(), summary=str(series.geometry))
        covers = Coverage(series.geometry).words | {"half turns": self._half_turns(series)}
        say("\n".join(f"{name}: {value}" for name, value in covers.items()))
        say(description)

    def _half_turns(self, series: CTPDSeries) -> str:
        """Whether both halves of a turn show the same edges."""
        parts = half_turn_views(series.geometry)
        shift = column_shift(*(read_scan(self.scan, views=views) for views in parts)) if parts else None
        if shift is None:
            return "the data do not tell whether they agree"
        if abs(shift) < _AGREEMENT:
            return f"their edges agree within {max(1, math.ceil(10 * abs(shift))) / 10:g} columns"
        used = series.layout.central_column if self.central_column is None else self.central_column
        return (
            f"their edges do NOT agree; they would with the central column {used - shift:.2f} instead of {used:g}: "
            "import again with --central-column"
        )

    def _description(self, series: CTPDSeries, source: dict[str, str]) -> str:
        layout, currents = series.layout, series.tube_currents_ma
        passed = [name for name in ("Manufacturer", "ManufacturerModelName", "SeriesDescription") if name in source]
        what = ["DICOM-CT-PD", *(source[name] for name in passed)]
        what += [f"{layout.tube_voltage_kvp:g} kVp"] if layout.tube_voltage_kvp else []
        ends = dict.fromkeys([f"{currents.min():g}", f"{currents.max():g}"])
        what += [f"{' to '.join(ends)} mA"] if currents.any() else []
        quanta = "those of PhotonStatistics" if self.incident is None else f"{self.incident:g} at the mean tube current"
        without = f" Not corrected for: {', '.join(layout.uncorrected)}." if layout.uncorrected else ""
        return (
            f"{', '.join(what)}. Incident quanta are {quanta}; the electronic noise is taken as "
            f"{self.electronic_noise:g} quanta, which the files do not state.{without} Patient position "
            f"{source.get('PatientPosition', 'unknown')}; left and right cannot be known from projections: compare "
            "them with the images of the scanner."
        )
