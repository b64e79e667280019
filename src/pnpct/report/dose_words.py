"""What may be said about dose, and when."""

from dataclasses import dataclass

from markupsafe import Markup

from pnpct.comparison import Comparison, Task
from pnpct.report.images import labels
from pnpct.report.marked_numbers import Numbers
from pnpct.report.task_charts import HOTELLING
from pnpct.report.words import spell_exactly


@dataclass(frozen=True)
class Claim:
    """All that a sentence about dose needs.

    Args:
        index: The task's place in the comparison.
        task: The task.
        reference: Method and tube current that set the mark.
        share: Share of the reference's dose.
        high: Upper end of its interval.
        control: Place of the control's task in the comparison.
        control_share: The control's share of the same dose.
    """

    index: int
    task: Task
    reference: str
    share: float
    high: float
    control: int
    control_share: float

    @property
    def holds(self) -> bool:
        """Whether less dose is needed, beyond doubt and beyond what blurring does."""
        return self.high < min(1.0, self.control_share)


def dose_statements(comparison: Comparison, numbers: Numbers) -> tuple[Markup, ...]:
    """Return a sentence for each method: what may be said about dose, for its least favourable lesion.

    Only with a task, an observer, the kernel of the reference, an interval and the control does a sentence speak
    of dose reduction; otherwise it says at which tube currents was measured.
    """
    methods = [method.name for method in comparison.methods if method.kind not in ("control", "fbp")]
    return tuple(filter(None, (_statement(comparison, numbers, method) for method in methods)))


def _statement(comparison: Comparison, numbers: Numbers, method: str) -> Markup:
    tasks = [
        (index, task)
        for index, task in enumerate(comparison.tasks)
        if (task.method, task.observer) == (method, HOTELLING)
    ]
    claims = [_claim(comparison, index, task) for index, task in tasks]
    complete = [claim for claim in claims if claim is not None]
    label = labels(comparison)[method]
    if not tasks:
        return Markup()
    if len(complete) < len(tasks):
        currents = sorted({point.tube_current_ma for _, task in tasks for point in task.points})
        return Markup(
            "<b>{}</b> was measured at {} mA. Nothing is said about dose: the share, its interval or that of the "
            "control is missing for some lesion."
        ).format(label, ", ".join(map(spell_exactly, currents)))
    return _spoken(comparison, numbers, label, max(complete, key=lambda claim: claim.share))


def _spoken(comparison: Comparison, numbers: Numbers, label: str, claim: Claim) -> Markup:
    at = "tasks", claim.index, "equal_dose"
    share, low, high = (numbers(*at, name, scale=100.0) for name in ("share", "low", "high"))
    of_control = numbers("tasks", claim.control, "equal_dose", "share", scale=100.0)
    verdict = (
        "For this task and this observer that is a dose reduction."
        if claim.holds
        else "No saving is shown: the interval reaches the whole dose, or what the control reaches by blurring."
    )
    return Markup(
        "<b>{}</b>: to find {}, the least favourable lesion, a {} observer needs {} % (95 % interval {} to {} %) of "
        "the dose of {}; with the control, {}, it needs {} %. {}"
    ).format(
        *(label, claim.task.lesion, claim.task.observer, share, low, high, claim.reference),
        *(labels(comparison)[comparison.tasks[claim.control].method], of_control, verdict),
    )


def _claim(comparison: Comparison, index: int, task: Task) -> Claim | None:
    """What a task says about dose, None if anything is missing."""
    dose = task.equal_dose
    if dose is None or dose.share is None or dose.low is None or dose.high is None:
        return None
    controls = {method.name for method in comparison.methods if method.kind == "control"}
    for place, other in enumerate(comparison.tasks):
        alike = (other.observer, other.lesion) == (task.observer, task.lesion) and other.method in controls
        if alike and other.equal_dose is not None and other.equal_dose.share is not None:
            return Claim(index, task, dose.reference, dose.share, dose.high, place, other.equal_dose.share)
    return None
