"""`pnpct compare`: the methods of the paper and their controls on the same scans, and the report on them."""

import os
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional

from pnpct.cli.parsing import option
from pnpct.cli.terminal import say, track
from pnpct.comparison import (
    RESULTS,
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
from pnpct.operators import Kernel
from pnpct.report import panel_rows, write_panels, write_report

FURTHER_MA = (20.0, 200.0)
"""Tube currents at which inserts are looked for besides those of the scans, mA."""

PHANTOM_MA = 100.0
"""Tube current of the phantoms for noise power and sharpness, mA."""


@dataclass(frozen=True)
class Compare:
    """Compare the methods of the paper, total variation and blurred FBP on the same scans.

    The folder gets all images, metrics.json, metrics.csv, report.html, and panel.png and .svg. Interrupted and
    started again, it continues.

    Args:
        folder: Where everything shall be; it is made.
        scans: Scans, or slices of a data set (exposures) that scans are drawn from.
        tube_currents_ma: Of the scans that are drawn, mA.
        tube_voltage_kvp: Of the scans that are drawn, kVp.
        kernel: Of FBP that all methods are measured against.
        blur_pixels: Standard deviation of the blurred FBP, the control, pixels.
        tv_strength: Strength of total variation, HU times pixel.
        supervised: Network trained on dose pairs alone, by name or file.
        two_stage: Network trained in two stages, by name or file.
        beta: Penalty of plug-and-play ADMM.
        iterations: Its most iterations.
        lesion_hu: Contrast of a lesion that is put into each scan, HU; 0 puts none, and takes half the time.
        lesion_diameter: Its diameter, mm.
        phantom_repeats: Scans of the phantoms for noise power and sharpness, at least 2; 0 leaves these out.
        detectability_pairs: Scans with and without inserts at each dose of a phantom, at least 40; 0 leaves it out.
        seed: Of everything that is drawn.
        processes: Cases that are worked on at the same time.
    """

    folder: Positional[Path]
    scans: Positional[tuple[Path, ...]]
    tube_currents_ma: tuple[float, ...] = (40.0, 70.0, 100.0)
    tube_voltage_kvp: float = 120.0
    kernel: Kernel = Plan.kernel
    blur_pixels: float = Plan.blur_pixels
    tv_strength: float = Plan.tv_strength_hu
    supervised: str = Plan.supervised
    two_stage: str = Plan.two_stage
    beta: float = Plan.beta
    iterations: int = Plan.iterations
    lesion_hu: float = Plan.lesion_hu
    lesion_diameter: float = Plan.lesion_diameter
    phantom_repeats: int = 4
    detectability_pairs: int = 0
    seed: int = 0
    processes: Annotated[int | None, option(default="one for each processor")] = None

    def run(self, command: Sequence[str]) -> None:
        """Compare, measure, and write the report."""
        plan = Plan(
            self.kernel,
            self.blur_pixels,
            self.tv_strength,
            self.supervised,
            self.two_stage,
            self.beta,
            self.iterations,
            self.lesion_hu,
            self.lesion_diameter,
            self.seed,
        )
        voltage = self.tube_voltage_kvp
        drawn = subjects_of(
            self.scans, tube_currents_ma=self.tube_currents_ma, tube_voltage_kvp=voltage, seed=self.seed
        )
        subjects = list(drawn)
        processes = min((os.cpu_count() or 1) if self.processes is None else self.processes, len(subjects) or 1)
        found = compare_cases(self.folder, subjects, plan, processes=processes)
        by_name = {one.case.name: one for one in track(found, total=len(subjects), of="Comparing")}
        candidates = plan.candidates()
        curves: Iterable[Curve] = ()
        if self.phantom_repeats:
            curves = phantom_curves(
                candidates,
                tube_current_ma=PHANTOM_MA,
                tube_voltage_kvp=voltage,
                repeats=self.phantom_repeats,
                seed=self.seed,
            )
        tasks: Iterable[Task] = ()
        if self.detectability_pairs:
            doses = sorted({*self.tube_currents_ma, *FURTHER_MA})
            tasks = phantom_tasks(
                candidates,
                tube_currents_ma=doses,
                tube_voltage_kvp=voltage,
                pairs=self.detectability_pairs,
                seed=self.seed,
            )
        provenance = record_run(command, inputs=self.scans, seed=self.seed, settings=asdict(plan))
        results = [by_name[subject.name] for subject in subjects]
        comparison = summarise(
            results,
            plan,
            provenance=provenance,
            curves=list(track(curves, total=2 * len(candidates), of="Noise and sharpness")),
            tasks=list(track(tasks, total=4 * len(candidates) + 8, of="Detectability"))
            if self.detectability_pairs
            else (),
        )
        write_comparison(self.folder, comparison)
        write_table(self.folder, comparison)
        failed = write_report(self.folder, self.folder / "report.html")
        rows = panel_rows(self.folder, comparison)
        for suffix in ("png", "svg"):
            write_panels(self.folder / f"panel.{suffix}", rows, provenance=provenance)
        say(f"Wrote {self.folder}: {RESULTS}, report.html and {len(results)} cases; {failed} checks failed.")
