"""A whole comparison: cases side by side in several processes, then the numbers over all of them."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from pnpct.comparison.case_results import CaseResults, compare_case, texture_spec
from pnpct.comparison.honesty import LARGEST_HELD_OUT_T, LARGEST_T, WEAKER
from pnpct.comparison.measures import score_definitions
from pnpct.comparison.outcomes import LEAST_D_PRIME, RECOVERED
from pnpct.comparison.phantom_results import PhantomResults
from pnpct.comparison.plan import Plan
from pnpct.comparison.results import Comparison, LesionResult, Numbers
from pnpct.comparison.subjects import REFERENCE_MA, Subject
from pnpct.comparison.texture_group import TextureGroup, texture_group
from pnpct.evaluation import FEATURES
from pnpct.evaluation.data.consistency import CORRELATED, OBJECT
from pnpct.evaluation.image.tissue_errors import TISSUES
from pnpct.evaluation.texture.change import LEAST_CASES
from pnpct.files import Provenance
from pnpct.operators.processes import side_by_side


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
    yield from side_by_side(compare_case, [(folder, subject, plan) for subject in subjects], processes=processes)


def summarise(
    results: Sequence[CaseResults],
    plan: Plan,
    *,
    provenance: Provenance,
    phantoms: PhantomResults | None = None,
) -> Comparison:
    """Put all cases together, with the change of texture over them.

    Args:
        results: Of all cases, in the order in which they are shown.
        plan: The methods and their settings.
        provenance: How the comparison was made.
        phantoms: What phantoms say of the methods; None if none was scanned.
    """
    tested = phantoms or PhantomResults()
    fidelity: Numbers = {one.case.name: one.fidelity for one in results}
    texture: Numbers = {
        one.case.name: {name: {key: getattr(values, key) for key in FEATURES} for name, values in one.texture.items()}
        for one in results
    }
    lesions: tuple[LesionResult, ...] = tuple(lesion for one in results for lesion in one.lesions)
    return Comparison(
        provenance,
        {**_definitions(results, plan), **({"phantoms": tested.definitions} if tested.definitions else {})},
        tuple(candidate.method for candidate in plan.candidates()),
        tuple(one.case for one in results),
        fidelity,
        texture,
        _texture_groups(results, plan),
        {one.case.name: one.histogram for one in results},
        tested.curves,
        tested.tasks,
        lesions,
        (*(check for one in results for check in one.checks), *tested.checks),
        tested.least_reductions,
    )


def _texture_groups(results: Sequence[CaseResults], plan: Plan) -> dict[str, TextureGroup]:
    """The change of every method from FBP, over the cases of one tube current in which texture could be measured."""
    groups: dict[str, list[CaseResults]] = {}
    for one in results:
        if one.texture:
            current = one.case.tube_current_ma
            known = ", truth known" if "truth" in one.texture else ""
            groups.setdefault(f"measured{known}" if current is None else f"{current:g} mA", []).append(one)
    methods = [candidate.method.name for candidate in plan.candidates()]
    return {
        words: texture_group([one.texture for one in group], [one.patient for one in group], methods, seed=plan.seed)
        for words, group in groups.items()
    }


def _definitions(results: Sequence[CaseResults], plan: Plan) -> dict[str, Any]:
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
        "plan": asdict(plan),
    }
    return dict(json.loads(json.dumps(definitions)))  # as it will be read, with lists for tuples
