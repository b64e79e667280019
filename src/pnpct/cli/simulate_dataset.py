"""`pnpct simulate dataset`: from a seed to the scans that a denoiser is trained on."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional

from pnpct.cli.artefact import finish
from pnpct.cli.parsing import option
from pnpct.cli.terminal import track
from pnpct.cli.workers import Cluster, chosen_workers
from pnpct.files import MANIFEST, record_run
from pnpct.simulation import ANATOMIES, Recipe, Simulator, plan, simulate_dataset


@dataclass(frozen=True)
class SimulateDataset:
    """Simulate a data set of many patients, each slice without noise and at several tube voltages.

    Training and `pnpct simulate draw` later draw noisy scans from it, at any tube current. Patients are split into
    training, validation and test. An interrupted run continues when it is started again.

    Args:
        folder: Output folder; it is created if need be.
        anatomy: Body regions of the procedural patients, separated by commas.
        cases: Number of procedural patients.
        body: Further patients: folders with a DICOM CT series, volumes in HU (.npz) or XCIST phantoms (.json, .zip).
        noise_hu: Noise in the CT series, which is removed before they are scanned: its standard deviation, HU.
        scale: Smallest and largest factor by which patients are scaled; none is made larger than the field of view.
        stations: Axial scans per patient, spread over the length of the body.
        rows: Detector rows; each gives one slice, 0.625 mm from the next.
        tube_voltages_kvp: Peak tube voltages of each scan, 70 to 140 kVp.
        simulator: pnpct's own simulator, or CatSim if gecatsim is installed.
        views: Views per rotation.
        bins: Detector cells along the arc.
        size: Rows and columns of the truth; the phantom itself has pixels of half that size.
        blur: Model the blur of the focal spot, the detector cells and the rotation during a view; takes about twice as
            long.
        validation: Fraction of the patients held out for validation.
        test: Fraction of the patients held out for testing.
        seed: Random seed.
        processes: Number of scans simulated in parallel.
        cluster: Address of the scheduler of a Dask cluster, whose workers simulate the scans.
    """

    folder: Positional[Path]
    anatomy: Annotated[str, option(metavar="NAME,NAME,...")] = ",".join(ANATOMIES)
    cases: int = Recipe.cases
    body: Annotated[tuple[Path, ...], option(default="none")] = ()
    noise_hu: float = Recipe.noise_hu
    scale: tuple[float, float] = Recipe.scale
    stations: int = Recipe.stations
    rows: int = Recipe.rows
    tube_voltages_kvp: tuple[float, ...] = Recipe.tube_voltages_kvp
    simulator: Simulator = Recipe.simulator
    views: int = Recipe.views
    bins: int = Recipe.bins
    size: int = Recipe.size
    blur: bool = Recipe.blur
    validation: float = Recipe.validation
    test: float = Recipe.test
    seed: int = Recipe.seed
    processes: Annotated[int | None, option(default="one per processor")] = None
    cluster: Cluster = None

    def run(self, command: Sequence[str]) -> None:
        """Simulate the scans that are missing."""
        recipe = Recipe(
            anatomies=tuple(name.strip() for name in self.anatomy.split(",") if name.strip()),
            bodies=tuple(map(str, self.body)),
            **{field.name: getattr(self, field.name) for field in fields(Recipe) if hasattr(self, field.name)},
        )
        workers = chosen_workers(self.processes, self.cluster, usual=os.cpu_count() or 1)
        scans = simulate_dataset(self.folder, recipe, **workers)
        done = list(track(scans, total=len(plan(recipe)), of="Scanning patients"))
        provenance = record_run(command, seed=self.seed)
        slices = sum(len(scan.files) for scan in done)
        finish(self.folder / MANIFEST, provenance, summary=f"{len(done)} scans with {slices} slices")
