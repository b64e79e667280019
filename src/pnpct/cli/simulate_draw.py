"""`pnpct simulate draw`: from a slice of a data set to a scan."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tyro.conf import Positional

from pnpct.cli.artefact import SCANS, check_output, finish_scan
from pnpct.cli.seeds import generators
from pnpct.files import read_exposure, record_run
from pnpct.physics import TUBE_VOLTAGE_KVP
from pnpct.simulation import TUBE_CURRENT_MA


@dataclass(frozen=True)
class SimulateDraw:
    """Draw a noisy scan from a slice of a data set.

    The slice was simulated without noise; each seed gives another scan of the same patient. The scan file holds the
    truth.

    Args:
        exposures: Slice of a data set, .h5.
        scan: File for the scan, .h5.
        tube_current_ma: Tube current, mA, at a rotation time of one second.
        tube_voltage_kvp: Tube voltage, one of those of the data set, kVp.
        seed: Random seed of the noise.
    """

    exposures: Positional[Path]
    scan: Positional[Path]
    tube_current_ma: float = TUBE_CURRENT_MA
    tube_voltage_kvp: float = TUBE_VOLTAGE_KVP
    seed: int = 0

    def run(self, command: Sequence[str]) -> None:
        """Read, draw, and write the scan."""
        check_output(self.scan, SCANS, inputs=[self.exposures])
        _, of_noise = generators(self.seed)
        exposed = read_exposure(self.exposures, tube_voltage_kvp=self.tube_voltage_kvp)
        scan = exposed.exposure.scan(tube_current_ma=self.tube_current_ma, generator=of_noise)
        known = None if exposed.truth is None or exposed.grid is None else (exposed.truth, exposed.grid)
        provenance = record_run(command, inputs=[self.exposures], seed=self.seed)
        finish_scan(self.scan, scan, provenance=provenance, truth=known)
