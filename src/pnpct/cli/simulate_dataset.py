"""`pnpct simulate dataset`: from a seed to the scans that a denoiser learns from."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional

from pnpct.cli.artefact import finish
from pnpct.cli.parsing import option
from pnpct.cli.terminal import track
from pnpct.files import MANIFEST, record_run
from pnpct.simulation import ANATOMIES, Recipe, Simulator, plan, simulate_dataset


@dataclass(frozen=True)
class SimulateDataset:
    """Simulate a data set: many patients, each slice without noise and at several tube voltages.

    Scans of any tube current are drawn from it later, by training or by `pnpct simulate draw`. Patients are shared out
    among train, validation and test. Interrupted and started again, it continues.

    Args:
        folder: Where the data set shall be; it is made.
        anatomy: Parts of the body of the patients who are made up, with commas between them.
        cases: How many patients are made up.
        body: Further patients: folders with a DICOM CT series, volumes of HU (.npz), XCIST phantoms (.json, .zip).
        noise_hu: Standard deviation of the noise that is removed from CT series, HU.
        stations: Axial scans of each patient, spread over the height.
        rows: Detector rows; each gives a slice, 0.625 mm from the next.
        tube_voltages_kvp: Peak tube voltages of each scan, 70 to 140 kVp.
        simulator: Our own, or CatSim where gecatsim is installed.
        views: Views in a turn.
        bins: Cells that share the detector's arc.
        size: Rows and columns of the truth; what is scanned has pixels of half the size.
        validation: Share of the patients that is kept for validation.
        test: Share of the patients that is kept for tests.
        seed: Seed of all that is drawn.
        processes: Scans that are made at the same time.
    """

    folder: Positional[Path]
    anatomy: Annotated[str, option(metavar="NAME,NAME,...")] = ",".join(ANATOMIES)
    cases: int = Recipe.cases
    body: tuple[Path, ...] = ()
    noise_hu: float = Recipe.noise_hu
    stations: int = Recipe.stations
    rows: int = Recipe.rows
    tube_voltages_kvp: tuple[float, ...] = Recipe.tube_voltages_kvp
    simulator: Simulator = Recipe.simulator
    views: int = Recipe.views
    bins: int = Recipe.bins
    size: int = Recipe.size
    validation: float = Recipe.validation
    test: float = Recipe.test
    seed: int = Recipe.seed
    processes: Annotated[int | None, option(default="one for each processor")] = None

    def run(self, command: Sequence[str]) -> None:
        """Simulate what is not there yet."""
        recipe = Recipe(
            anatomies=tuple(name.strip() for name in self.anatomy.split(",") if name.strip()),
            bodies=tuple(map(str, self.body)),
            cases=self.cases,
            noise_hu=self.noise_hu,
            stations=self.stations,
            rows=self.rows,
            tube_voltages_kvp=self.tube_voltages_kvp,
            simulator=self.simulator,
            views=self.views,
            bins=self.bins,
            size=self.size,
            validation=self.validation,
            test=self.test,
            seed=self.seed,
        )
        processes = (os.cpu_count() or 1) if self.processes is None else self.processes
        scans = simulate_dataset(self.folder, recipe, processes=processes)
        done = list(track(scans, total=len(plan(recipe)), of="Scanning patients"))
        provenance = record_run(command, seed=self.seed)
        slices = sum(len(scan.files) for scan in done)
        finish(self.folder / MANIFEST, provenance, summary=f"{len(done)} scans with {slices} slices")
