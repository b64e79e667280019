"""`pnpct import arrays`: from NumPy arrays and a geometry to a scan."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional

from pnpct.cli.artefact import SCANS, check_output, finish_scan
from pnpct.cli.parsing import option
from pnpct.cli.terminal import say
from pnpct.files import file_and_member, import_arrays, record_run
from pnpct.units import MU_WATER_70_KEV


@dataclass(frozen=True)
class ImportArrays:
    """Make a scan from NumPy or MATLAB files of counts or line integrals, and a geometry in JSON.

    To name one of several arrays in a file, write scan.npz:counts. pnpct.files.geometry_json lists the keys of the
    geometry.

    Args:
        array: Counts or line integrals, views x bins, in .npy, .npz or .mat.
        geometry: The geometry in .json, or a .mat file of HelTomo (as in the Helsinki Tomography Challenge).
        scan: File for the scan, .h5.
        incident: Counts in air, without an object: a number, or a file with one value per bin, view or ray. It may be
            left out for line integrals: FBP does not need it, and the weights are then estimated from the noise.
        kind: What the array contains; line integrals are -ln(counts/incident).
        mask: File with 0 where a ray was not measured and 1 elsewhere, per bin, view or ray. Rays that are NaN or have
            no incident counts are left out in any case.
        electronic_noise: Standard deviation of the electronic noise per count, quanta.
        mu_water: Attenuation coefficient of water at the effective energy, 1/mm.
        beam_hardening: File with the coefficients of the water correction, bins x powers, highest power first.
        signal_per_quantum: Detector signal per quantum, in the unit of the counts; 1 if they are quanta already.
        insist: Accept values that look like a mistake, such as lengths in another unit.
    """

    array: Positional[Path]
    geometry: Positional[Path]
    scan: Positional[Path]
    incident: Annotated[float | Path | None, option(metavar="NUMBER|FILE", default="estimated for line integrals")] = (
        None
    )
    mask: Annotated[Path | None, option(default="all were measured")] = None
    kind: Literal["line-integrals", "counts"] = "line-integrals"
    electronic_noise: float = 0.0
    mu_water: Annotated[float, option(default=f"{MU_WATER_70_KEV:.5f}, at 70 keV")] = MU_WATER_70_KEV
    beam_hardening: Annotated[Path | None, option(default="no correction")] = None
    signal_per_quantum: float = 1.0
    insist: bool = False

    def run(self, command: Sequence[str]) -> None:
        """Read, and write the scan."""
        arrays = (self.array, self.incident, self.mask, self.beam_hardening)
        inputs = [self.geometry, *(file_and_member(array)[0] for array in arrays if isinstance(array, Path))]
        check_output(self.scan, SCANS, inputs=inputs)
        imported = import_arrays(
            self.array,
            self.geometry,
            kind=self.kind,
            incident=self.incident,
            mask=self.mask,
            electronic_noise=self.electronic_noise,
            mu_water=self.mu_water,
            beam_hardening=self.beam_hardening,
            signal_per_quantum=self.signal_per_quantum,
            insist=self.insist,
        )
        notes = {"notes": list(imported.notes)} if imported.notes else None
        finish_scan(self.scan, imported.scan, provenance=record_run(command, inputs=inputs, settings=notes))
        for note in imported.notes:
            say(note)
