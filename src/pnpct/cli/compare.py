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
    PhantomTests,
    Plan,
    Subject,
    compare_cases,
    measure_phantoms,
    phantom_jobs,
    phantom_results,
    subjects_of,
    summarise,
    write_comparison,
    write_table,
)
from pnpct.files import record_run

CURRENTS_MA, VOLTAGE_KVP = (40.0, 70.0, 100.0), 120.0
"""Defaults for scans that are drawn, and for phantoms."""


@dataclass(frozen=True)
class Compare(Plan):
    """Compare the methods of the paper, total variation and blurred FBP on the same scans.

    The folder gets all images, metrics.json, metrics.csv, report.html, and panel.png and .svg. If it is interrupted and
    started again, it continues.

    Args:
        folder: Output folder; it is created.
        scans: Scans, or slices of a data set (exposures) that scans are drawn from.
        tube_currents_ma: Of the scans that are drawn, mA; detectability is measured at these and at 20, 200 and 400.
        tube_voltage_kvp: Of the scans that are drawn and of the phantoms, kVp.
        phantom_repeats: Phantom scans for noise power (NPS) and resolution (TTF), at least 2; 0 omits these.
        detectability_pairs: Phantom scans with and without inserts at each dose level, at least 40; 0 omits them.
        processes: Cases, and then methods on phantoms, that run in parallel.
    """

    folder: Positional[Path]
    scans: Positional[tuple[Path, ...]]
    tube_currents_ma: Annotated[tuple[float, ...] | None, option(default="40 70 100", metavar="FLOAT [FLOAT ...]")] = (
        None
    )
    tube_voltage_kvp: Annotated[float | None, option(default=VOLTAGE_KVP)] = None
    phantom_repeats: int = PhantomTests.repeats
    detectability_pairs: int = PhantomTests.pairs
    processes: Annotated[int | None, option(default="one per processor")] = None

    def run(self, command: Sequence[str]) -> None:
        """Compare, measure, and write the report."""
        plan = Plan(**{field.name: getattr(self, field.name) for field in fields(Plan)})
        doses = CURRENTS_MA if self.tube_currents_ma is None else self.tube_currents_ma
        voltage = VOLTAGE_KVP if self.tube_voltage_kvp is None else self.tube_voltage_kvp
        subjects = list(subjects_of(self.scans, tube_currents_ma=doses, tube_voltage_kvp=voltage, seed=plan.seed))
        self._check_effect(subjects)
        repeats, pairs = self.phantom_repeats, self.detectability_pairs
        tests = PhantomTests(repeats=repeats, pairs=pairs, tube_currents_ma=doses, tube_voltage_kvp=voltage)
        jobs = phantom_jobs(plan, tests)
        processes = (os.cpu_count() or 1) if self.processes is None else self.processes
        found = compare_cases(self.folder, subjects, plan, processes=min(processes, len(subjects) or 1))
        by_name = {one.case.name: one for one in track(found, total=len(subjects), of="Comparing")}
        measured = measure_phantoms(self.folder, jobs, processes=processes)
        records = list(track(measured, total=len(jobs), of="Phantoms"))
        comparison = summarise(
            [by_name[subject.name] for subject in subjects],
            plan,
            provenance=record_run(command, inputs=self.scans, seed=self.seed, settings=asdict(plan)),
            phantoms=phantom_results(records, plan, tests),
        )
        write_comparison(self.folder, comparison)
        write_table(self.folder, comparison)
        Report(self.folder).run(command)

    def _check_effect(self, subjects: Sequence[Subject]) -> None:
        options = {"--tube-currents-ma": self.tube_currents_ma, "--tube-voltage-kvp": self.tube_voltage_kvp}
        given = [name for name, value in options.items() if value is not None]
        if given and subjects and all(subject.tube_current_ma is None for subject in subjects):
            raise ValueError(f"All of these are scans, so none is drawn: leave out {' and '.join(given)}.")
