"""`pnpct compare`: the methods of the paper and their controls on the same scans, and the report on them."""

import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional

from pnpct.cli.parsing import option
from pnpct.cli.report import Report
from pnpct.cli.terminal import track
from pnpct.comparison import (
    Candidate,
    Curve,
    Plan,
    Task,
    compare_cases,
    phantom_curves,
    phantom_tasks,
    subjects_of,
    summarise,
    write_comparison,
    write_table,
)
from pnpct.files import record_run

FURTHER_MA = (20.0, 200.0)
"""Tube currents at which inserts are looked for besides those of the scans, mA."""

PHANTOM_MA = 100.0
"""Tube current of the phantoms for noise power and sharpness, mA."""


@dataclass(frozen=True)
class Compare(Plan):
    """Compare the methods of the paper, total variation and blurred FBP on the same scans.

    The folder gets all images, metrics.json, metrics.csv, report.html, and panel.png and .svg. Interrupted and
    started again, it continues.

    Args:
        folder: Where everything shall be; it is made.
        scans: Scans, or slices of a data set (exposures) that scans are drawn from.
        tube_currents_ma: Of the scans that are drawn, mA.
        tube_voltage_kvp: Of the scans that are drawn, kVp.
        phantom_repeats: Scans of the phantoms for noise power and sharpness, at least 2; 0 leaves these out.
        detectability_pairs: Scans with and without inserts at each dose of a phantom, at least 40; 0 leaves it out.
        processes: Cases that are worked on at the same time.
    """

    folder: Positional[Path]
    scans: Positional[tuple[Path, ...]]
    tube_currents_ma: tuple[float, ...] = (40.0, 70.0, 100.0)
    tube_voltage_kvp: float = 120.0
    phantom_repeats: int = 4
    detectability_pairs: int = 0
    processes: Annotated[int | None, option(default="one for each processor")] = None

    def run(self, command: Sequence[str]) -> None:
        """Compare, measure, and write the report."""
        plan = Plan(**{field.name: getattr(self, field.name) for field in fields(Plan)})
        doses, voltage = self.tube_currents_ma, self.tube_voltage_kvp
        subjects = list(subjects_of(self.scans, tube_currents_ma=doses, tube_voltage_kvp=voltage, seed=self.seed))
        processes = min((os.cpu_count() or 1) if self.processes is None else self.processes, len(subjects) or 1)
        found = compare_cases(self.folder, subjects, plan, processes=processes)
        by_name = {one.case.name: one for one in track(found, total=len(subjects), of="Comparing")}
        candidates = plan.candidates()
        comparison = summarise(
            [by_name[subject.name] for subject in subjects],
            plan,
            provenance=record_run(command, inputs=self.scans, seed=self.seed, settings=asdict(plan)),
            curves=self._curves(candidates) if self.phantom_repeats else [],
            tasks=self._tasks(candidates) if self.detectability_pairs else [],
        )
        write_comparison(self.folder, comparison)
        write_table(self.folder, comparison)
        Report(self.folder).run(command)

    def _curves(self, candidates: Sequence[Candidate]) -> list[Curve]:
        found = phantom_curves(
            candidates,
            tube_current_ma=PHANTOM_MA,
            tube_voltage_kvp=self.tube_voltage_kvp,
            repeats=self.phantom_repeats,
            seed=self.seed,
        )
        return list(track(found, total=2 * len(candidates), of="Noise and sharpness"))

    def _tasks(self, candidates: Sequence[Candidate]) -> list[Task]:
        found = phantom_tasks(
            candidates,
            tube_currents_ma=sorted({*self.tube_currents_ma, *FURTHER_MA}),
            tube_voltage_kvp=self.tube_voltage_kvp,
            pairs=self.detectability_pairs,
            seed=self.seed,
        )
        return list(track(found, total=4 * len(candidates) + 8, of="Detectability"))
