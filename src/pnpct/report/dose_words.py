"""What may be said about dose, and when."""

from dataclasses import dataclass

from markupsafe import Markup

from pnpct.comparison import Comparison, DoseShare, LeastReduction, Task
from pnpct.report.marked_numbers import Numbers
from pnpct.report.results import Results
from pnpct.report.tasks import HOTELLING, spelled_share
from pnpct.report.words import spell_exactly


@dataclass(frozen=True)
class Claim:
    """All that a sentence about dose needs.

    Args:
        place: Of what the method saves in all tasks, in the comparison.
        least: That.
        tasks: What it needs for each lesion, and what the control needs for it.
        control_place: Of what the control saves in all tasks.
        control: That.
    """

    place: int
    least: LeastReduction
    tasks: tuple[tuple[DoseShare, DoseShare], ...]
    control_place: int
    control: LeastReduction

    @property
    def holds(self) -> bool:
        """Whether less dose is needed for every lesion, beyond doubt and beyond what blurring does."""
        pairs = (*self.tasks, (self.least.equal_dose, self.control.equal_dose))
        return self.least.equal_dose.share.high < 1.0 and all(own.share.high < other.share.low for own, other in pairs)

    @property
    def costs(self) -> bool:
        """Whether more dose is needed for some lesion, beyond doubt."""
        return self.least.equal_dose.share.low > 1.0


def dose_statements(results: Results) -> tuple[Markup, ...]:
    """Return a sentence for each method: what may be said about dose, for all lesions together.

    Only with tasks, an observer, the kernel of the reference, an interval and the control does a sentence speak
    of dose reduction; otherwise it says at which tube currents was measured.
    """
    methods = [method for method in results.methods if method not in {*results.controls, results.baseline}]
    return tuple(filter(None, (_statement(results, method) for method in methods)))


def _statement(results: Results, method: str) -> Markup:
    tasks = [task for task in results.comparison.tasks if (task.method, task.observer) == (method, HOTELLING)]
    if not tasks:
        return Markup()
    claim = _claim(results.comparison, method, tasks)
    if claim is None:
        currents = sorted({point.tube_current_ma for task in tasks for point in task.points})
        return Markup(
            "<b>{}</b> was measured at {} mA. Nothing is said about dose: its share or that of the control "
            "is missing for some lesion."
        ).format(results.label(method), ", ".join(map(spell_exactly, currents)))
    return _spoken(results, claim)


def _spoken(results: Results, claim: Claim) -> Markup:
    numbers, least = results.numbers, claim.least
    if claim.holds:
        verdict = "For these tasks and this observer that is a dose reduction."
    elif claim.costs:
        verdict = "No saving is shown: this lesion takes more dose than with the reference."
    else:
        verdict = (
            "No saving is shown: the interval reaches the whole dose, or for some lesion what the control reaches by "
            "blurring."
        )
    return Markup(
        "<b>{}</b>: to find every lesion, the least favourable being {}, a {} observer needs {} % of the dose of {} "
        "(95 % interval {} to {} %); with {} it needs {} % (95 % interval {} to {} %). {}"
    ).format(
        *(results.label(least.method), least.lesion, least.observer),
        *_shares(numbers, claim.place, least.equal_dose),
        results.label(claim.control.method),
        *_shares(numbers, claim.control_place, claim.control.equal_dose, reference=False),
        verdict,
    )


def _shares(numbers: Numbers, place: int, dose: DoseShare, *, reference: bool = True) -> tuple[str, ...]:
    """The share, what it is a share of, and the ends of its interval."""
    at = "least_reductions", place, "equal_dose"
    ends = (numbers(*at, "share", name, scale=100.0) for name in ("low", "high"))
    return spelled_share(numbers, dose, *at), *((dose.reference,) if reference else ()), *ends


def _claim(comparison: Comparison, method: str, tasks: list[Task]) -> Claim | None:
    """What all tasks of a method say about dose, None if anything is missing."""
    controls = [each.name for each in comparison.methods if each.role == "control"]
    found = {least.method: (n, least) for n, least in enumerate(comparison.least_reductions)}
    control = next((name for name in controls if name in found), None)
    if method not in found or control is None:
        return None
    of_control = {
        task.lesion: task.equal_dose
        for task in comparison.tasks
        if (task.method, task.observer) == (control, HOTELLING)
    }
    pairs = []
    for task in tasks:
        own, other = task.equal_dose, of_control.get(task.lesion)
        if own is None or other is None:
            return None
        pairs.append((own, other))
    return Claim(*found[method], tuple(pairs), *found[control])
