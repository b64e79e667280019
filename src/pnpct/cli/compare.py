"""`pnpct compare`: the methods of the paper, their controls and yours on the same scans, and the report on them."""

import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any

import tyro
from tyro.conf import Positional, Suppress, UseAppendAction

from pnpct.cli.parsing import option
from pnpct.cli.report import Report
from pnpct.cli.terminal import track
from pnpct.cli.workers import Cluster, chosen_workers
from pnpct.comparison import PaperMethods, Phantoms, Study, compare, imported_methods, subjects_of


@dataclass(frozen=True, kw_only=True)
class Compare(PaperMethods, Study):
    """Compare the methods of the paper, total variation, blurred FBP and your own on the same scans.

    All images, metrics.json, metrics.csv, report.html, panel.png and panel.svg are written to the folder. An
    interrupted run continues when it is started again.

    Args:
        folder: Output folder; it is created if need be.
        scans: Scans, or slices of a data set (exposures) from which scans are drawn.
        method: Another method to compare, of your own: a callable (sinogram, A), a mapping from names to several, or a
            function that returns either, importable from the working directory or an installed package.
        processes: Number of cases, and then of methods on phantoms, that run in parallel.
        cluster: Address of the scheduler of a Dask cluster, whose workers run them.
    """

    folder: Positional[Path]
    scans: Positional[tuple[Path, ...]]
    denoiser: UseAppendAction[Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME")]] = PaperMethods.denoiser
    method: UseAppendAction[Annotated[tuple[str, ...], tyro.conf.arg(metavar="MODULE:NAME")]] = ()
    processes: Annotated[int | None, option(default="one per processor")] = None
    cluster: Cluster = None
    phantoms: Suppress[Phantoms] = Study.phantoms

    def run(self, command: Sequence[str]) -> None:
        """Compare, measure, and write the report."""
        study = Study(**{field.name: getattr(self, field.name) for field in fields(Study)})
        self._check_effect(study)
        methods = self.candidates()
        for path in self.method:
            methods = methods.with_methods(imported_methods(path))
        workers = chosen_workers(self.processes, self.cluster, usual=os.cpu_count() or 1)
        given = self.folder, self.scans, methods
        compare(*given, study=study, command=command, **workers, progress=_shown)
        Report(self.folder).run(command)

    def _check_effect(self, study: Study) -> None:
        of_drawn = ("tube_currents_ma", "tube_voltage_kvp")
        changed = [name for name in of_drawn if getattr(study, name) != getattr(Study, name)]
        drawn = [subject.tube_current_ma is not None for subject in subjects_of(self.scans, study)]
        if changed and drawn and not any(drawn):
            options = " and ".join(f"--{name.replace('_', '-')}" for name in changed)
            raise ValueError(f"All of these are scans, so none is drawn: leave out {options}.")


def _shown(items: Iterable[Any], total: int, of: str) -> Iterator[Any]:
    return track(items, total=total, of=of)
