"""How well lesions are found against dose, and what that says about dose."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from markupsafe import Markup

from pnpct.comparison import Comparison, DoseShare, Task
from pnpct.report.axes import fitted
from pnpct.report.charts import ACROSS, UP, Line, LineChart, Point
from pnpct.report.images import labels
from pnpct.report.marked_numbers import Numbers
from pnpct.report.tables import Head, Row, Table
from pnpct.report.words import spell, spell_exactly

HOTELLING, NPWE = "channelised Hotelling", "NPWE"


@dataclass(frozen=True)
class Found:
    """What an observer found of one lesion: the task's places in `metrics.json`, and the tasks."""

    observer: str
    lesion: str
    tasks: tuple[tuple[int, Task], ...]


def groups(comparison: Comparison) -> tuple[Found, ...]:
    """Return the tasks by observer and lesion; those of NPWE only where the control is among them.

    NPWE takes blurring for a gain, which can be seen only beside blurred FBP.
    """
    controls = {method.name for method in comparison.methods if method.role == "control"}
    keys = dict.fromkeys((task.observer, task.lesion) for task in comparison.tasks)
    found = (Found(*key, tuple(_tasks(comparison, *key))) for key in sorted(keys, key=lambda key: key[0] == NPWE))
    return tuple(
        group for group in found if group.observer != NPWE or {task.method for _, task in group.tasks} & controls
    )


def left_out(comparison: Comparison) -> int:
    """Return how many tasks are not shown because the control is missing beside them."""
    return len(comparison.tasks) - sum(len(group.tasks) for group in groups(comparison))


def task_charts(comparison: Comparison, numbers: Numbers, styles: Mapping[str, str]) -> tuple[LineChart, ...]:
    """Return a chart for each observer and lesion: d′ over tube current, both logarithmic."""
    return tuple(_chart(group, labels(comparison), numbers, styles) for group in groups(comparison))


def task_tables(comparison: Comparison, numbers: Numbers, styles: Mapping[str, str]) -> tuple[Table, ...]:
    """Return the numbers of each chart."""
    heads = (Head("tube current", "mA"), Head("d′"), Head("95 % from"), Head("to"), Head("AUC"))
    names = (*(("d_prime", end) for end in ("estimate", "low", "high")), ("auc",))
    return tuple(
        Table(
            _title(group),
            heads,
            tuple(
                Row(
                    labels(comparison).get(task.method, task.method),
                    (
                        numbers.exact("tasks", index, "points", point, "tube_current_ma"),
                        *(numbers("tasks", index, "points", point, "found", *name) for name in names),
                    ),
                    styles.get(task.method, ""),
                )
                for index, task in group.tasks
                for point in range(len(task.points))
            ),
        )
        for group in groups(comparison)
    )


def spelled_share(numbers: Numbers, dose: DoseShare, *path: str | int) -> Markup:
    """Return the share of a dose in percent, or on which side of the measured doses it lies.

    Args:
        numbers: The numbers of the comparison.
        dose: The share.
        path: Where it is among them.
    """
    words = {"below": "less than ", "above": "more than ", None: ""}[dose.outside]
    return Markup("{}{}").format(words, numbers(*path, "share", "estimate", scale=100.0))


def equal_dose_table(comparison: Comparison, numbers: Numbers, styles: Mapping[str, str]) -> Table:
    """Return the shares of the reference's dose at which a lesion is found as well, and then every lesion."""
    heads = (
        *(Head(title, words=True) for title in ("lesion", "observer", "measured against")),
        *(Head("share of its dose", "%"), Head("95 % from", "%"), Head("to", "%")),
    )
    shown = {index for group in groups(comparison) for index, _ in group.tasks}
    found = [
        *(
            (task.method, task.lesion, task.observer, task.equal_dose, ("tasks", index))
            for index, task in enumerate(comparison.tasks)
            if index in shown
        ),
        *(
            (least.method, "every lesion", least.observer, least.equal_dose, ("least_reductions", index))
            for index, least in enumerate(comparison.least_reductions)
        ),
    ]
    rows = []
    for method, lesion, observer, dose, place in found:
        if dose is not None:
            path = (*place, "equal_dose")
            ends = (numbers(*path, "share", name, scale=100.0) for name in ("low", "high"))
            cells = (lesion, observer, dose.reference, spelled_share(numbers, dose, *path), *ends)
            rows.append(Row(labels(comparison).get(method, method), cells, styles.get(method, "")))
    return Table("Share of the dose at which a lesion is found as well", heads, tuple(rows))


def _tasks(comparison: Comparison, observer: str, lesion: str) -> Iterator[tuple[int, Task]]:
    for index, task in enumerate(comparison.tasks):
        if (task.observer, task.lesion) == (observer, lesion):
            yield index, task


def _title(group: Found) -> str:
    return f"{group.lesion}, {group.observer} observer"


def _chart(found: Found, names: Mapping[str, str], numbers: Numbers, styles: Mapping[str, str]) -> LineChart:
    points = [point for _, task in found.tasks for point in task.points]
    x = fitted((point.tube_current_ma for point in points), ACROSS, title="tube current, mA", log=True)
    found_d = [point.found.d_prime for point in points]
    y = fitted((value for d in found_d for value in (d.estimate, d.low, d.high)), UP, title="d′", log=True)
    lines = tuple(
        Line(
            label=names.get(task.method, task.method),
            style=styles.get(task.method, ""),
            points=tuple(
                Point(
                    x.at(point.tube_current_ma),
                    y.at(d.estimate),
                    y.at(d.low),
                    y.at(d.high),
                    f"{names.get(task.method, task.method)}, {spell_exactly(point.tube_current_ma)} mA: d′ "
                    f"{spell(d.estimate)} ({spell(d.low)} to {spell(d.high)})",
                )
                for point in task.points
                if (d := point.found.d_prime).estimate > 0  # no logarithm, but its numbers are in the table
            ),
            whence=numbers.attributes("tasks", index),
            dots=True,
        )
        for index, task in found.tasks
    )
    says = f"Detectability over tube current for {_title(found)}; numbers are in the table below."
    return LineChart(_title(found), says, x, y, lines)
