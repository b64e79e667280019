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

    Name one of several arrays in a file as in scan.npz:counts. pnpct.files.geometry_json lists the geometry's keys.

    Args:
        array: Counts or line integrals, views x bins, .npy, .npz or .mat.
        geometry: The geometry, .json, or a .mat file of HelTomo (such as the Helsinki Tomography Challenge).
        scan: File for the scan, .h5.
        incident: Counts expected without an object (air): a number, or a file with one for each bin, view or
            ray. For line integrals it may be left out: FBP needs none, and for weights it is estimated from the noise.
        kind: What the array holds; line integrals are -ln(counts/incident).
        mask: File with 0 where a ray was not measured, else 1: for each bin, view or ray. Rays that are NaN or have an
            incident of 0 were not measured either.
        electronic_noise: Standard deviation of the electronic noise of a count, quanta.
        mu_water: Attenuation of water at the effective energy, 1/mm; the default is its value at 70 keV.
        beam_hardening: File of the correction's coefficients, bins x powers, highest power first.
        signal_per_quantum: Signal of one quantum, in the unit of counts and incident; 1 if these are quanta.
        insist: Take numbers that look like a mistake, such as lengths in another unit.
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
    mu_water: float = MU_WATER_70_KEV
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
