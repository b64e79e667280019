"""`pnpct import catsim`: from the raw files of CatSim to a scan."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional

from pnpct.cli.artefact import SCANS, check_output, finish_scan
from pnpct.cli.parsing import option
from pnpct.cli.terminal import working
from pnpct.files import file_and_member, record_run, scan_from_catsim
from pnpct.units import MU_WATER_70_KEV


@dataclass(frozen=True)
class ImportCatsim:
    """Make a scan from the raw files of CatSim: one detector row of an axial scan, or all rows of any scan.

    Args:
        prefix: Path of the raw files, without .scan, .prep, .air or .offset.
        scan: File for the scan, .h5.
        configuration: CatSim's configuration files, of which later ones override earlier ones; or one JSON file with
            the same keys.
        signal: raw reads .scan, .air and .offset; prep reads .prep, in which CatSim has already corrected low signals.
        detector_row: Index of the detector row, from 0.
        all_rows: Read all detector rows, of an axial or a helical scan.
        kev_per_quantum: Energy that counts as one quantum, keV.
        incident: Quanta per ray in air, without an object.
        mu_water: Attenuation coefficient of water at the effective energy, 1/mm.
        beam_hardening: NumPy file with the coefficients of the water correction, columns x powers, highest power first.
    """

    prefix: Positional[Path]
    scan: Positional[Path]
    configuration: tuple[Path, ...]
    signal: Literal["raw", "prep"] = "raw"
    detector_row: Annotated[int | None, option(default="the middle one")] = None
    all_rows: bool = False
    kev_per_quantum: float = 70.0
    incident: Annotated[float | None, option(default="those of the air scan")] = None
    mu_water: Annotated[float, option(default=f"{MU_WATER_70_KEV:.5f}, at 70 keV")] = MU_WATER_70_KEV
    beam_hardening: Annotated[Path | None, option(default="no correction")] = None

    def run(self, command: Sequence[str]) -> None:
        """Read, and write the scan."""
        raw = [Path(f"{self.prefix}.{suffix}") for suffix in ("scan", "prep", "air", "offset")]
        inputs = [*(path for path in raw if path.is_file()), *self.configuration]
        inputs += [file_and_member(self.beam_hardening)[0]] if self.beam_hardening else []
        check_output(self.scan, SCANS, inputs=inputs)
        with working("Reading"):
            scan = scan_from_catsim(
                self.prefix,
                configuration=self.configuration,
                signal=self.signal,
                detector_row=self.detector_row,
                all_rows=self.all_rows,
                kev_per_quantum=self.kev_per_quantum,
                incident=self.incident,
                mu_water=self.mu_water,
                beam_hardening=self.beam_hardening,
            )
        finish_scan(self.scan, scan, provenance=record_run(command, inputs=inputs))
