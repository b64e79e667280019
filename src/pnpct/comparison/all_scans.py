"""A whole comparison: cases side by side in several processes, the phantoms, and the numbers over all of them."""

import json
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from pnpct.comparison.data_checks import LARGEST_HELD_OUT_T, LARGEST_T, WEAKER
from pnpct.comparison.dose_tasks import with_phantoms
from pnpct.comparison.lesion_checks import LEAST_D_PRIME, RECOVERED
from pnpct.comparison.measures import score_definitions
from pnpct.comparison.methods import Candidates, Reconstruct, controls, unpacked
from pnpct.comparison.metrics_file import write_comparison
from pnpct.comparison.one_scan import OneScan, compare_one_scan, texture_spec
from pnpct.comparison.phantom_measurements import measure_phantoms, phantom_jobs
from pnpct.comparison.schema import Comparison, Numbers, TextureGroup
from pnpct.comparison.study import Study
from pnpct.comparison.subjects import REFERENCE_MA, Subject, subjects_of
from pnpct.comparison.table import write_table
from pnpct.evaluation import FEATURES, TISSUES, Texture, rank_by_closeness, texture_change
from pnpct.evaluation.data.consistency import CORRELATED, OBJECT
from pnpct.evaluation.texture.change import LEAST_CASES
from pnpct.files import Provenance, record_run, sole_writer
from pnpct.operators.processes import side_by_side

Item = TypeVar("Item")


def unwatched(items: Iterable[Item], _total: int, _of: str) -> Iterable[Item]:
    """Let what is done pass."""
    return items


def compare(
    folder: Path,
    scans: Sequence[Path],
    methods: Mapping[str, Reconstruct] | Candidates,
    *,
    study: Study | None = None,
    processes: int = 1,
    cluster: str | None = None,
    command: Sequence[str] = ("pnpct.comparison.compare",),
    progress: Callable[[Iterable[Any], int, str], Iterable[Any]] = unwatched,
) -> Comparison:
    """Compare methods on scans and phantoms, and write the images, `metrics.json` and `metrics.csv`.

    What an interrupted run has made is read, where the settings of its method are the same. A function without
    `settings` is known by its name alone: choose another folder when it has changed.

    Args:
        folder: Output folder; it is created.
        scans: Scans, or slices of a data set (exposures) that scans are drawn from.
        methods: Any methods by name, which are measured against `controls`; or all candidates, the baseline among them.
        study: Doses, lesion, phantoms and seed; `Study()` if None.
        processes: Cases, and then methods on phantoms, that run in parallel. More than one needs
            methods that can be pickled, and a script with `if __name__ == "__main__":`.
        cluster: Address of the scheduler of a Dask cluster, whose workers take the place of processes.
        command: What is written down as the command.
        progress: From an iterator, how much it yields and what, to the same: shows what is done as it passes.

    Raises:
        OSError: If a file cannot be read or written, another process writes there, or a process dies.
        ValueError: If a scan, a method or a setting is not what it should be.
    """
    study = Study() if study is None else study
    methods = methods if isinstance(methods, Candidates) else controls().with_methods(methods)
    subjects = list(subjects_of(scans, study))
    if not subjects:
        raise ValueError("A comparison needs at least one scan.")
    if processes > 1 or cluster is not None:  # what cannot be had is said before the work
        _ = [method.packed() for method in methods]
    jobs = phantom_jobs(methods, study)
    folder.mkdir(parents=True, exist_ok=True)
    with sole_writer(folder):
        at_once = min(processes, len(subjects))
        with closing(compare_scans(folder, subjects, methods, study, processes=at_once, cluster=cluster)) as made:
            by_name = {one.case.name: one for one in progress(made, len(subjects), "Comparing")}
        with closing(measure_phantoms(folder, jobs, processes=processes, cluster=cluster)) as made_of_phantoms:
            measured = list(progress(made_of_phantoms, len(jobs), "Phantoms"))
        settings = {"study": study.settings, "methods": {each.name: dict(each.settings) for each in methods}}
        provenance = record_run(command, inputs=scans, seed=study.seed, settings=settings)
        cases = [by_name[subject.name] for subject in subjects]
        comparison = with_phantoms(summarise(cases, methods, study, provenance=provenance), measured, methods, study)
        write_comparison(folder, comparison)
        write_table(folder, comparison)
    return comparison


def compare_scans(
    folder: Path,
    subjects: Sequence[Subject],
    methods: Candidates,
    study: Study,
    *,
    processes: int = 1,
    cluster: str | None = None,
) -> Generator[OneScan, None, None]:
    """Compare scan by scan, and yield each when it is done; images that an earlier run has made are read.

    Args:
        folder: Of the comparison; it is made.
        subjects: The scans.
        methods: The methods.
        study: What is asked of them.
        processes: Scans that are worked on at the same time.
        cluster: Address of the scheduler of a Dask cluster, whose workers take the place of processes.

    Raises:
        OSError: If a file cannot be read or written, or a process dies.
        ValueError: If a scan or a setting is not what it should be.
    """
    folder.mkdir(parents=True, exist_ok=True)
    if processes == 1 and cluster is None:
        yield from (compare_one_scan(folder, subject, methods, study) for subject in subjects)
        return
    packed = tuple(method.packed() for method in methods)
    calls = [(folder, subject, packed, study) for subject in subjects]
    yield from side_by_side(_compare, calls, processes=processes, cluster=cluster)


def _compare(folder: Path, subject: Subject, methods: Sequence[bytes], study: Study) -> OneScan:
    return compare_one_scan(folder, subject, Candidates(tuple(map(unpacked, methods))), study)


def summarise(results: Sequence[OneScan], methods: Candidates, study: Study, *, provenance: Provenance) -> Comparison:
    """Put all cases together, with the change of texture over them.

    Args:
        results: Of all cases, in the order in which they are shown.
        methods: The methods.
        study: What was asked of them.
        provenance: How the comparison was made.
    """
    texture: Numbers = {
        one.case.name: {name: {key: getattr(values, key) for key in FEATURES} for name, values in one.texture.items()}
        for one in results
    }
    return Comparison(
        provenance,
        _definitions(results, study),
        tuple(method.described for method in methods),
        tuple(one.case for one in results),
        fidelity={one.case.name: one.fidelity for one in results},
        texture=texture,
        texture_change=_texture_groups(results, methods, study),
        histogram={one.case.name: one.histogram for one in results},
        lesions={one.case.name: one.lesions for one in results if one.lesions},
        checks=tuple(check for one in results for check in one.checks),
    )


def _texture_groups(results: Sequence[OneScan], methods: Candidates, study: Study) -> dict[str, TextureGroup]:
    """The change of every method from FBP, over the cases of one tube current in which texture could be measured."""
    groups: dict[str, list[OneScan]] = {}
    for one in results:
        if one.texture:
            current = one.case.tube_current_ma
            known = ", truth known" if "truth" in one.texture else ""
            groups.setdefault(f"measured{known}" if current is None else f"{current:g} mA", []).append(one)
    return {words: _texture_group(group, methods, seed=study.seed) for words, group in groups.items()}


def _texture_group(group: Sequence[OneScan], methods: Candidates, *, seed: int) -> TextureGroup:
    """Texture against the baseline and the reference, over the scans of one tube current."""
    patients = [one.patient for one in group]

    def textures(name: str) -> list[Texture]:
        return [one.texture[name] for one in group]

    baseline = textures(methods.baseline.name)
    reference = textures("reference") if all("reference" in one.texture for one in group) else None
    changes = {}
    for name in (method.name for method in methods if method.role != "baseline"):
        generator = np.random.default_rng(seed)
        changes[name] = texture_change(textures(name), baseline, reference, generator=generator, cases=patients)
    patches = sum(len(each.patches) for each in baseline)
    return TextureGroup(len(set(patients)), patches, changes, rank_by_closeness(changes))


def _definitions(results: Sequence[OneScan], study: Study) -> dict[str, Any]:
    """What the numbers depend on besides the images; where patches and discs are is said by each case."""
    specs = {"glcm": texture_spec(truth_known=True), "glcm_without_truth": texture_spec(truth_known=False)}
    used = {one.case.texture_spec_hash for one in results}
    definitions: dict[str, Any] = {
        **{
            name: {**asdict(spec), "spec_hash": spec.hash}
            for name, spec in specs.items()
            if name == "glcm" or spec.hash in used
        },
        "texture": {"least_patients_for_interval": LEAST_CASES, "reference_ma": REFERENCE_MA},
        "scores": score_definitions(),
        "emd_window_hu": specs["glcm"].window,
        "emd_mask": "body",
        "tissues_hu": dict(TISSUES),
        "score_test": {
            "disc_mm": sorted({one.case.disc_mm for one in results if one.case.disc_mm is not None}),
            "mask": "body",
            "taken_off": "|T| of the truth at the same place",
            "largest_t": LARGEST_T,
            "largest_cross_view_t": LARGEST_HELD_OUT_T,
            "prior_off_share_of_penalty": WEAKER,
        },
        "residual": {"least_line_integral": OBJECT, "correlation_above_truth": CORRELATED},
        "lesion_recovery": {"passes": RECOVERED, "least_d_prime": LEAST_D_PRIME},
        "study": study.settings,
    }
    return dict(json.loads(json.dumps(definitions)))  # as it will be read, with lists for tuples
