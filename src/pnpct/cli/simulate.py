"""`pnpct simulate`: from a seed to a scan."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tyro.conf import Positional

from pnpct.cli.artefact import SCANS, check_output, finish_scan
from pnpct.cli.grids import square_grid
from pnpct.cli.seeds import generators
from pnpct.cli.terminal import working
from pnpct.files import record_run
from pnpct.simulation import chest_phantom, clinical_fan_beam, simulate_scan, truth

FIELD_OF_VIEW = 450.0  # mm


@dataclass(frozen=True)
class Simulate:
    """Simulate a scan of a chest.

    A slice at the heart, another patient for every seed, is scanned by a scanner of today. The scan keeps the truth.

    Args:
        scan: Where the scan shall be, .h5.
        tube_current_ma: Tube current, mA, for a rotation of one second; 40 is a low dose, 200 a usual one.
        tube_voltage_kvp: Peak tube voltage, 40 to 150 kVp.
        views: Views in the turn.
        bins: Cells that share the detector's arc.
        size: Rows and columns of the truth, over 450 mm; the patient is drawn with pixels of half the size.
        seed: Seed of the patient and of the noise.
    """

    scan: Positional[Path]
    tube_current_ma: float = 40.0
    tube_voltage_kvp: float = 120.0
    views: int = 984
    bins: int = 900
    size: int = 512
    seed: int = 0

    def run(self, command: Sequence[str]) -> None:
        """Simulate, and write the scan."""
        check_output(self.scan, SCANS)
        if self.bins < 1:
            raise ValueError(f"A detector needs at least one bin, got {self.bins}.")
        of_patient, of_noise = generators(self.seed)
        grid = square_grid(self.size, FIELD_OF_VIEW)
        with working("Drawing and scanning the patient"):
            phantom = chest_phantom(of_patient, grid=square_grid(2 * self.size, FIELD_OF_VIEW))
            scan = simulate_scan(
                phantom,
                clinical_fan_beam(views=self.views, bins=self.bins),
                tube_current_ma=self.tube_current_ma,
                tube_voltage_kvp=self.tube_voltage_kvp,
                generator=of_noise,
            )
        known = truth(phantom, grid), grid
        finish_scan(self.scan, scan, provenance=record_run(command, seed=self.seed), truth=known)
