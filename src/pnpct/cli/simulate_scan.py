"""`pnpct simulate scan`: from a seed, or a patient's images, to a scan."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional

from pnpct.cli.artefact import SCANS, check_output, finish_scan
from pnpct.cli.parsing import option
from pnpct.cli.seeds import generators
from pnpct.cli.terminal import say, working
from pnpct.files import record_run
from pnpct.geometry import DEFAULT_SIZE
from pnpct.physics import TUBE_VOLTAGE_KVP
from pnpct.simulation import (
    ANATOMIES,
    BINS,
    BLURRED,
    BOWTIE,
    DETECTOR,
    TUBE_CURRENT_MA,
    VIEWS,
    Bowtie,
    Detector,
    clinical_fan_beam,
    expose,
    fingerprint,
    from_files,
    procedural_patient,
    scanner_beam,
    truth,
)

USUAL_ANATOMY = "chest"


@dataclass(frozen=True)
class SimulateScan:
    """Simulate a scan of one slice.

    The scanner is like a modern clinical one. The patient is procedural, another one for each seed, or read from files.
    The scan file holds the truth too.

    Args:
        scan: File for the scan, .h5.
        anatomy: Body region of a procedural patient.
        body: Patient to scan instead: a folder with a DICOM CT series, a volume in HU (.npz) or an XCIST phantom
            (.json, .zip).
        series: SeriesInstanceUID of the series to read, if the folder of --body holds several.
        z: Height of the slice, mm.
        noise_hu: Noise in the CT series, which is removed before the scan is simulated: its standard deviation, HU.
        tube_current_ma: Tube current, mA, for a rotation time of one second; 40 is a low dose, 200 a routine one.
        tube_voltage_kvp: Peak tube voltage, 70 to 140 kVp.
        bowtie: Bow-tie filter, for a large, medium or small body.
        detector: Type of detector.
        crosstalk: Fraction of the x-rays of a detector cell that each of its neighbours detects.
        blur: Model the blur of the focal spot, the detector cells and the rotation during a view; takes two to
            three times as long.
        views: Views per rotation.
        bins: Detector cells along the arc.
        size: Rows and columns of the truth; the phantom itself has pixels of half that size.
        seed: Random seed of the patient and of the noise.
    """

    scan: Positional[Path]
    anatomy: Annotated[str | None, option(default=USUAL_ANATOMY, metavar=f"{{{','.join(ANATOMIES)}}}")] = None
    body: Annotated[Path | None, option(default="a procedural patient")] = None
    series: Annotated[str | None, option(metavar="UID", default="the only one")] = None
    z: Annotated[float | None, option(default="a slice with much anatomy, or the middle of --body")] = None
    noise_hu: float = 0.0
    tube_current_ma: float = TUBE_CURRENT_MA
    tube_voltage_kvp: float = TUBE_VOLTAGE_KVP
    bowtie: Bowtie = BOWTIE
    detector: Detector = DETECTOR
    crosstalk: float = 0.0
    blur: bool = False
    views: int = VIEWS
    bins: int = BINS
    size: int = DEFAULT_SIZE
    seed: int = 0

    def run(self, command: Sequence[str]) -> None:
        """Simulate, and write the scan."""
        check_output(self.scan, SCANS)
        for name in ("bins", "size"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1, got {getattr(self, name)}.")
        if self.body and self.anatomy:
            raise ValueError("--anatomy takes a procedural patient and --body reads one; give only one of them.")
        if not 0 <= self.noise_hu < math.inf or (self.noise_hu and not self.body):
            raise ValueError(
                f"--noise-hu is the noise of a CT series, at least 0, and needs --body, got {self.noise_hu}."
            )
        if self.series and not self.body:
            raise ValueError("--series chooses among the series in the folder of --body; give that folder too.")
        of_patient, of_noise = generators(self.seed)
        inputs = {str(self.body): fingerprint(self.body)} if self.body else {}
        geometry = clinical_fan_beam(views=self.views, bins=self.bins)
        beam = scanner_beam(
            geometry, tube_voltage_kvp=self.tube_voltage_kvp, bowtie=self.bowtie, detector=self.detector
        )
        with working("Drawing and scanning the patient"):
            if self.body:
                source = from_files(self.body, size=self.size, noise_hu=self.noise_hu, series_uid=self.series)
            else:
                source = procedural_patient(self.anatomy or USUAL_ANATOMY, of_patient, size=self.size)
            phantom = source.body.slice(source.height if self.z is None else self.z, source.grid.halved)
            exposure = expose(
                phantom, geometry, beam, sampling=BLURRED if self.blur else None, crosstalk=self.crosstalk
            )
            scan = exposure.scan(tube_current_ma=self.tube_current_ma, generator=of_noise)
        for note in source.notes:
            say(note)
        known = truth(phantom, source.grid, energy=beam.effective_energy), source.grid
        known_of_body = {"bodies": inputs} if inputs else {"body_part": (self.anatomy or USUAL_ANATOMY).upper()}
        provenance = record_run(command, seed=self.seed, settings=known_of_body)
        finish_scan(self.scan, scan, provenance=provenance, truth=known)
