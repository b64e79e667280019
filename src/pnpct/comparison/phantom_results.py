"""What the phantoms say of the methods: curves, detectability at each dose, and the dose that a method could save."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from pnpct.comparison.phantom_records import PhantomRecord, phantom_candidates
from pnpct.comparison.phantom_tests import FULL_MA, PhantomTests, in_words
from pnpct.comparison.plan import Plan
from pnpct.comparison.results import Check, Curve, DosePoint, DoseShare, LeastReduction, Method, Task, Verdict
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
from pnpct.geometry import Insert

HOTELLING: Literal["channelised Hotelling"] = "channelised Hotelling"

MOST_FROM_BLUR = 0.15
"""How far from all of the reference's dose the control may need: a blur adds no information and takes little away."""

Found = Mapping[Insert, Sequence[InsertDetectability]]
"""Of one method: by insert, at rising dose."""


@dataclass(frozen=True)
class PhantomResults:
    """All that the phantoms say.

    Args:
        curves: Noise power and transfer.
        tasks: Detectability against dose.
        least_reductions: What a method saves in all tasks.
        checks: Whether a blur seems to save dose, and what could not be measured.
        definitions: What the numbers depend on; empty where nothing was measured.
    """

    curves: tuple[Curve, ...] = ()
    tasks: tuple[Task, ...] = ()
    least_reductions: tuple[LeastReduction, ...] = ()
    checks: tuple[Check, ...] = ()
    definitions: Mapping[str, Any] = field(default_factory=dict)


def phantom_results(records: Sequence[PhantomRecord], plan: Plan, tests: PhantomTests) -> PhantomResults:
    """Put the records of all jobs together.

    In each task the mark is d′ of FBP with the best of its kernels at the full dose. A task in which d′ is not
    positive at some dose, or was not measured at all, has no equal dose; its method has no least reduction then.

    Args:
        records: Of all jobs, in any order.
        plan: The methods and their settings.
        tests: The phantoms and their scans.
    """
    methods = [candidate.method for candidate in phantom_candidates(plan)]
    own = [method for place, method in enumerate(methods) if place == 0 or method.kind != "fbp"]
    records = sorted(records, key=lambda record: record.place)
    curves = tuple(curve for record in records for curve in record.curves)
    failed = tuple(check for record in records for check in record.checks)
    if not tests.pairs:
        return PhantomResults(curves, checks=failed, definitions=tests.described())
    found = [_by_insert(records, place, tests) for place in range(len(methods))]
    marks = _marks([(method, found[n]) for n, method in enumerate(methods) if method.kind == "fbp"], tests)
    tasks: list[Task] = []
    least: list[LeastReduction] = []
    blur: list[Check] = []
    for method, by_insert in zip(own, found, strict=False):
        reduction = _reduction(by_insert, marks, tests, plan.seed)
        equal = {} if reduction is None else reduction.tasks
        shares = {insert: _share(one, marks[insert][0]) for insert, one in equal.items()}
        tasks.extend(_tasks(method, by_insert, shares))
        if reduction is not None and len(equal) == len(tests.phantoms.inserts):
            share = _share(reduction.least, marks[reduction.worst][0])
            least.append(LeastReduction(method.name, HOTELLING, in_words(reduction.worst), share))
        if method.kind == "control":
            blur.extend(_blur_check(method, insert, shares.get(insert)) for insert in tests.phantoms.inserts)
    return PhantomResults(curves, tuple(tasks), tuple(least), (*blur, *failed), tests.described())


def _by_insert(records: Sequence[PhantomRecord], place: int, tests: PhantomTests) -> Found:
    found = [one for record in records if record.place == place for one in record.found]
    found.sort(key=lambda one: one.tube_current_ma)
    return {insert: [one for one in found if one.insert == insert] for insert in tests.phantoms.inserts}


def _curve(found: Sequence[InsertDetectability], tests: PhantomTests) -> DoseCurve | None:
    """One insert's d′ against dose; None unless it is positive, with an error, at every dose."""
    if len(found) != len(tests.doses_ma):
        return None
    try:
        (curve,) = dose_curves(found).values()
    except ValueError:
        return None
    return curve


def _marks(kernels: Sequence[tuple[Method, Found]], tests: PhantomTests) -> dict[Insert, tuple[str, Interval]]:
    """For each insert the best FBP at full dose, in words and its d′; an insert that none has found is missing."""
    marks = {}
    for insert in tests.phantoms.inserts:
        curves = {method: _curve(found[insert], tests) for method, found in _named(kernels)}
        usable = {kernel: {insert: curve} for kernel, curve in curves.items() if curve is not None}
        if usable:
            best = best_references(*usable.values(), full_dose=FULL_MA)[insert]
            name = next(kernel for kernel, one in usable.items() if one[insert].fit().at(FULL_MA) == best)
            marks[insert] = f"FBP {name} at {FULL_MA:g} mA", best
    return marks


def _named(kernels: Sequence[tuple[Method, Found]]) -> Iterator[tuple[str, Found]]:
    for method, found in kernels:
        yield str(method.settings["kernel"]), found


def _reduction(
    found: Found, marks: Mapping[Insert, tuple[str, Interval]], tests: PhantomTests, seed: int
) -> DoseReduction[Insert] | None:
    """What a method saves in the tasks that can be judged; None if none can."""
    curves = {insert: _curve(found[insert], tests) for insert in marks}
    usable = {insert: curve for insert, curve in curves.items() if curve is not None}
    if not usable:
        return None
    reference = {insert: marks[insert][1] for insert in usable}
    return dose_reduction(usable, reference, full_dose=FULL_MA, generator=np.random.default_rng(seed))


def _share(equal: EqualDose, reference: str) -> DoseShare:
    part = equal.fraction
    return DoseShare(reference, part.estimate, part.low, part.high, equal.outside)


def _tasks(method: Method, found: Found, shares: Mapping[Insert, DoseShare]) -> Iterator[Task]:
    measured = {insert: records for insert, records in found.items() if records}
    for insert, records in measured.items():
        yield Task(method.name, HOTELLING, in_words(insert), _points(records, HOTELLING), shares.get(insert))
    if method.kind in ("fbp", "control"):
        for insert, records in measured.items():
            yield Task(method.name, "NPWE", in_words(insert), _points(records, "NPWE"))


def _points(
    records: Sequence[InsertDetectability], observer: Literal["channelised Hotelling", "NPWE"]
) -> tuple[DosePoint, ...]:
    points = []
    for record in records:
        judged = record.hotelling if observer == HOTELLING else record.npwe
        d = judged.d_prime
        points.append(DosePoint(record.tube_current_ma, d.estimate, d.low, d.high, judged.auc))
    return tuple(points)


def _blur_check(method: Method, insert: Insert, equal: DoseShare | None) -> Check:
    """Whether the observer is fooled by a blur: then no share of any method means anything."""
    limits = low, high = round(1 - MOST_FROM_BLUR, 9), round(1 + MOST_FROM_BLUR, 9)
    task = f"to find {in_words(insert)}"
    if equal is None or equal.share is None or equal.low is None or equal.high is None:
        says = f"What dose the blurred image needs {task} is not known: d′ is not positive at some dose."
        return Check("blur control", None, method.name, None, *limits, "not judged", says)
    verdict: Verdict = "fail" if equal.high < low or equal.low > high else "not judged"
    if low <= equal.share <= high and equal.outside is None:
        verdict = "pass"
    bound = {"below": "less than ", "above": "more than ", None: ""}[equal.outside]
    says = (
        f"The blurred image needs {bound}{100 * equal.share:.0f} % of the dose of {equal.reference} {task} (95 % "
        f"interval {100 * equal.low:.0f} to {100 * equal.high:.0f} %); a blur neither adds information nor takes much "
        "away."
    )
    if verdict == "not judged":
        says += " The interval is too wide to say so; more pairs of scans are needed."
    return Check("blur control", None, method.name, equal.share, *limits, verdict, says)
