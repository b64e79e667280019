"""A whole comparison: cases side by side in several processes, then the numbers over all of them."""

import json
from collections.abc import Iterator, Sequence
from concurrent.futures import as_completed
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from pnpct.comparison.case_results import CaseResults, compare_case
from pnpct.comparison.plan import Plan
from pnpct.comparison.results import Comparison, Curve, LesionResult, Numbers, Task
from pnpct.comparison.subjects import Subject
from pnpct.evaluation import FEATURES, FeatureChange, GLCMSpec, texture_change
from pnpct.evaluation.tissue_errors import TISSUES
from pnpct.files import Provenance
from pnpct.operators.processes import worker_processes


def compare_cases(
    folder: Path, subjects: Sequence[Subject], plan: Plan, *, processes: int = 1
) -> Iterator[CaseResults]:
    """Compare case by case, and yield each when it is done; images that an earlier run has made are read.

    Args:
        folder: Of the comparison; it is made.
        subjects: The scans.
        plan: The methods and their settings.
        processes: Cases that are worked on at the same time.

    Raises:
        OSError: If a file cannot be read or written, or a process dies.
        ValueError: If there is no scan, or a scan or a setting is not what it should be.
    """
    if not subjects:
        raise ValueError("A comparison needs at least one scan.")
    plan.candidates()  # what cannot be had is said before the work
    folder.mkdir(parents=True, exist_ok=True)
    if processes == 1:
        yield from (compare_case(folder, subject, plan) for subject in subjects)
        return
    with worker_processes(processes) as pool:
        jobs = [pool.submit(compare_case, folder, subject, plan) for subject in subjects]
        try:
            for job in as_completed(jobs):
                yield job.result()
        finally:
            pool.shutdown(cancel_futures=True)


def summarise(
    results: Sequence[CaseResults],
    plan: Plan,
    *,
    provenance: Provenance,
    curves: Sequence[Curve] = (),
    tasks: Sequence[Task] = (),
) -> Comparison:
    """Put all cases together, with the change of texture over them.

    Args:
        results: Of all cases, in the order in which they are shown.
        plan: The methods and their settings.
        provenance: How the comparison was made.
        curves: Noise power and transfer.
        tasks: Detectability against dose.
    """
    fidelity: Numbers = {one.case.name: one.fidelity for one in results}
    texture: Numbers = {
        one.case.name: {name: {key: getattr(values, key) for key in FEATURES} for name, values in one.texture.items()}
        for one in results
    }
    lesions: tuple[LesionResult, ...] = tuple(lesion for one in results for lesion in one.lesions)
    return Comparison(
        provenance,
        _definitions(plan),
        tuple(candidate.method for candidate in plan.candidates()),
        tuple(one.case for one in results),
        fidelity,
        texture,
        _texture_change(results, plan),
        {one.case.name: one.histogram for one in results},
        tuple(curves),
        tuple(tasks),
        lesions,
        tuple(check for one in results for check in one.checks),
    )


def _texture_change(results: Sequence[CaseResults], plan: Plan) -> dict[str, tuple[FeatureChange, ...]]:
    """The change of every method from FBP, over the cases in which texture could be measured."""
    measured = [one for one in results if one.texture]
    if not measured:
        return {}
    known = all("reference" in one.texture for one in measured)
    first, *others = (candidate.method.name for candidate in plan.candidates())

    def textures(name: str) -> list[Any]:
        return [one.texture[name] for one in measured]

    return {
        name: texture_change(
            textures(name),
            textures(first),
            textures("reference") if known else None,
            generator=np.random.default_rng(plan.seed),
            cases=[one.patient for one in measured],
        ).features
        for name in others
    }


def _definitions(plan: Plan) -> dict[str, Any]:
    spec = GLCMSpec()
    definitions = {
        "glcm": {**asdict(spec), "spec_hash": spec.hash},
        "emd_window_hu": spec.window,
        "tissues_hu": dict(TISSUES),
        "plan": asdict(plan),
    }
    return dict(json.loads(json.dumps(definitions)))  # as it will be read, with lists for tuples
