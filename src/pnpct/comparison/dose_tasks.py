"""What the phantoms say of dose: detectability in each task, and the dose that a method could save."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pnpct.comparison.methods import Candidate, Candidates
from pnpct.comparison.phantom_measurements import REFERENCE_KERNELS, PhantomMeasurement, reference_kernels
from pnpct.comparison.phantoms import CURVES_MA, FULL_MA, insert_settings, lesion_in_words
from pnpct.comparison.schema import Check, Comparison, DosePoint, DoseShare, LeastReduction, Observer, Task, Verdict
from pnpct.comparison.study import Study
from pnpct.evaluation import (
    DoseCurve,
    DoseReduction,
    EqualDose,
    InsertDetectability,
    Interval,
    best_references,
    dose_curves,
    dose_reduction,
)
from pnpct.evaluation.observers.detectability_by_dose import READER
from pnpct.geometry import Insert

HOTELLING: Observer = "channelised Hotelling"

MOST_FROM_BLUR = 0.15
"""How far from all of the reference's dose the control may need: a blur adds no information and takes little away."""

Found = Mapping[Insert, Sequence[InsertDetectability]]
"""Of one method: by insert, at rising dose."""


def with_phantoms(
    comparison: Comparison, measured: Sequence[PhantomMeasurement], methods: Candidates, study: Study
) -> Comparison:
    """Add what the phantoms say of the methods to a comparison.

    In each task the d′ to reach is that of FBP with the best of its kernels at the full dose. A task in which d′ is
    not positive at some dose, or was not measured at all, has no equal dose; its method has no least reduction then.

    Args:
        comparison: What is known of the cases.
        measured: The measurements of all jobs, in any order.
        methods: The methods.
        study: How the phantoms were scanned.
    """
    order = {each.name: place for place, each in enumerate((*methods, *reference_kernels(methods)[1:]))}
    measured = sorted(measured, key=lambda one: order[one.method])
    found = {name: _by_insert(measured, name, study) for name in order}
    kernels = {str(each.settings["kernel"]): found[each.name] for each in reference_kernels(methods)}
    references = _references(kernels, study) if study.detectability_pairs else {}
    tasks: list[Task] = []
    least: list[LeastReduction] = []
    blur: list[Check] = []
    for method in methods if study.detectability_pairs else ():
        reduction = _reduction(found[method.name], references, study)
        shares = (
            {}
            if reduction is None
            else {insert: _share(one, references[insert][0]) for insert, one in reduction.tasks.items()}
        )
        tasks.extend(_tasks(method, found[method.name], shares))
        if reduction is not None and len(shares) == len(study.phantoms.inserts):
            share = _share(reduction.least, references[reduction.worst][0])
            least.append(LeastReduction(method.name, HOTELLING, _words(reduction.worst), share))
        if method.role == "control":
            blur.extend(_blur_check(method.name, insert, shares.get(insert)) for insert in study.phantoms.inserts)
    definitions = _definitions(study)
    return replace(
        comparison,
        definitions={**comparison.definitions, **({"phantoms": definitions} if definitions else {})},
        curves=tuple(curve for one in measured for curve in one.curves),
        tasks=tuple(tasks),
        checks=(*comparison.checks, *blur, *(check for one in measured for check in one.checks)),
        least_reductions=tuple(least),
    )


def _definitions(study: Study) -> dict[str, Any]:
    """What the numbers depend on; nothing where nothing was measured."""
    phantoms = study.phantoms
    about: dict[str, Any] = {}
    if study.phantom_repeats:
        about["noise and sharpness"] = {
            "edge": insert_settings(phantoms.edge),
            "tube_current_ma": CURVES_MA,
            "repeats": study.phantom_repeats,
            "patch_pixels": phantoms.patch,
        }
    if study.detectability_pairs:
        about["detectability"] = {
            "pairs": study.detectability_pairs,
            "tube_currents_ma": list(study.doses_ma),
            "inserts": {_words(insert): insert_settings(insert) for insert in phantoms.inserts},
            "reference": {"kernels": list(REFERENCE_KERNELS), "tube_current_ma": FULL_MA},
            "eye of NPWE": {"distance_mm": READER.distance, "zoom": READER.zoom, "decay": READER.decay},
        }
    return {**phantoms.settings, "tube_voltage_kvp": study.tube_voltage_kvp, **about} if about else {}


def _words(insert: Insert) -> str:
    return lesion_in_words(insert.diameter, insert.contrast_hu)


def _by_insert(measured: Sequence[PhantomMeasurement], method: str, study: Study) -> Found:
    found = [one for each in measured if each.method == method for one in each.found]
    found.sort(key=lambda one: one.tube_current_ma)
    return {insert: [one for one in found if one.insert == insert] for insert in study.phantoms.inserts}


def _curve(found: Sequence[InsertDetectability], study: Study) -> DoseCurve | None:
    """One insert's d′ against dose; None unless it is positive, with an error, at every dose."""
    if len(found) != len(study.doses_ma):
        return None
    try:
        (curve,) = dose_curves(found).values()
    except ValueError:
        return None
    return curve


def _references(kernels: Mapping[str, Found], study: Study) -> dict[Insert, tuple[str, Interval]]:
    """For each insert the best FBP at full dose, in words and its d′; an insert that none has found is missing."""
    best = {}
    for insert in study.phantoms.inserts:
        curves = {kernel: _curve(found[insert], study) for kernel, found in kernels.items()}
        usable = {kernel: {insert: curve} for kernel, curve in curves.items() if curve is not None}
        if usable:
            d_prime = best_references(*usable.values(), full_dose=FULL_MA)[insert]
            name = next(kernel for kernel, one in usable.items() if one[insert].fit().at(FULL_MA) == d_prime)
            best[insert] = f"FBP {name} at {FULL_MA:g} mA", d_prime
    return best


def _reduction(
    found: Found, references: Mapping[Insert, tuple[str, Interval]], study: Study
) -> DoseReduction[Insert] | None:
    """What a method saves in the tasks that can be judged; None if none can."""
    curves = {insert: _curve(found[insert], study) for insert in references}
    usable = {insert: curve for insert, curve in curves.items() if curve is not None}
    if not usable:
        return None
    to_reach = {insert: references[insert][1] for insert in usable}
    return dose_reduction(usable, to_reach, full_dose=FULL_MA, generator=np.random.default_rng(study.seed))


def _share(equal: EqualDose, reference: str) -> DoseShare:
    return DoseShare(reference, equal.fraction, equal.outside)


def _tasks(method: Candidate, found: Found, shares: Mapping[Insert, DoseShare]) -> Iterator[Task]:
    measured = {insert: records for insert, records in found.items() if records}
    for insert, records in measured.items():
        points = tuple(DosePoint(one.tube_current_ma, one.hotelling) for one in records)
        yield Task(method.name, HOTELLING, _words(insert), points, shares.get(insert))
    if method.role in ("baseline", "control"):
        for insert, records in measured.items():
            yield Task(
                method.name, "NPWE", _words(insert), tuple(DosePoint(one.tube_current_ma, one.npwe) for one in records)
            )


def _blur_check(control: str, insert: Insert, equal: DoseShare | None) -> Check:
    """Whether the observer is fooled by a blur: then no share of any method means anything."""
    limits = low, high = round(1 - MOST_FROM_BLUR, 9), round(1 + MOST_FROM_BLUR, 9)
    task = f"to find {_words(insert)}"
    if equal is None:
        says = f"What dose the blurred image needs {task} is not known: d′ is not positive at some dose."
        return Check("blur control", None, control, None, *limits, "not judged", says)
    share = equal.share
    verdict: Verdict = "fail" if share.high < low or share.low > high else "not judged"
    if low <= share.estimate <= high and equal.outside is None:
        verdict = "pass"
    bound = {"below": "less than ", "above": "more than ", None: ""}[equal.outside]
    says = (
        f"The blurred image needs {bound}{100 * share.estimate:.0f} % of the dose of {equal.reference} {task} (95 % "
        f"interval {100 * share.low:.0f} to {100 * share.high:.0f} %); a blur neither adds information nor takes much "
        "away."
    )
    if verdict == "not judged":
        says += " The interval is too wide to say so; more pairs of scans are needed."
    return Check("blur control", None, control, share.estimate, *limits, verdict, says)
