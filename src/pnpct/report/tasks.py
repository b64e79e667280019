"""How well lesions are found against dose."""

from collections.abc import Iterator
from dataclasses import dataclass

from markupsafe import Markup

from pnpct.comparison import DoseShare, Task
from pnpct.report.drawing import Chart, Line, line_chart
from pnpct.report.marked_numbers import Numbers
from pnpct.report.results import Results
from pnpct.report.tables import Head, Row, Table

HOTELLING, NPWE = "channelised Hotelling", "NPWE"


@dataclass(frozen=True)
class Found:
    """What an observer found of one lesion: the task's places in `metrics.json`, and the tasks."""

    observer: str
    lesion: str
    tasks: tuple[tuple[int, Task], ...]


def groups(results: Results) -> tuple[Found, ...]:
    """Return the tasks by observer and lesion; those of NPWE only where the control is among them.

    NPWE takes blurring for a gain, which can be seen only beside blurred FBP.
    """
    keys = dict.fromkeys((task.observer, task.lesion) for task in results.comparison.tasks)
    found = (Found(*key, tuple(_tasks(results, *key))) for key in sorted(keys, key=lambda key: key[0] == NPWE))
    return tuple(
        group
        for group in found
        if group.observer != NPWE or {task.method for _, task in group.tasks} & results.controls
    )


def left_out(results: Results) -> int:
    """Return how many tasks are not shown because the control is missing beside them."""
    return len(results.comparison.tasks) - sum(len(group.tasks) for group in groups(results))


def task_charts(results: Results) -> tuple[Chart, ...]:
    """Return a chart for each observer and lesion: d′ over tube current, both logarithmic."""
    return tuple(_chart(results, group) for group in groups(results))


def task_tables(results: Results) -> tuple[Table, ...]:
    """Return the numbers of each chart."""
    heads = (Head("tube current", "mA"), Head("d′"), Head("95 % from"), Head("to"), Head("AUC"))
    names = (*(("d_prime", end) for end in ("estimate", "low", "high")), ("auc",))
    return tuple(
        Table(
            _title(group),
            heads,
            tuple(
                Row(
                    results.label(task.method),
                    (
                        results.numbers.exact("tasks", index, "points", point, "tube_current_ma"),
                        *(results.numbers("tasks", index, "points", point, "found", *name) for name in names),
                    ),
                    results.style(task.method),
                )
                for index, task in group.tasks
                for point in range(len(task.points))
            ),
        )
        for group in groups(results)
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


def equal_dose_table(results: Results) -> Table:
    """Return the shares of the reference's dose at which a lesion is found as well, and then every lesion."""
    heads = (
        *(Head(title, words=True) for title in ("lesion", "observer", "measured against")),
        *(Head("share of its dose", "%"), Head("95 % from", "%"), Head("to", "%")),
    )
    shown = {index for group in groups(results) for index, _ in group.tasks}
    found = [
        *(
            (task.method, task.lesion, task.observer, task.equal_dose, ("tasks", index))
            for index, task in enumerate(results.comparison.tasks)
            if index in shown
        ),
        *(
            (least.method, "every lesion", least.observer, least.equal_dose, ("least_reductions", index))
            for index, least in enumerate(results.comparison.least_reductions)
        ),
    ]
    rows = []
    for method, lesion, observer, dose, place in found:
        if dose is not None:
            path = (*place, "equal_dose")
            ends = (results.numbers(*path, "share", name, scale=100.0) for name in ("low", "high"))
            cells = (lesion, observer, dose.reference, spelled_share(results.numbers, dose, *path), *ends)
            rows.append(Row(results.label(method), cells, results.style(method)))
    return Table("Share of the dose at which a lesion is found as well", heads, tuple(rows))


def _tasks(results: Results, observer: str, lesion: str) -> Iterator[tuple[int, Task]]:
    for index, task in enumerate(results.comparison.tasks):
        if (task.observer, task.lesion) == (observer, lesion):
            yield index, task


def _title(group: Found) -> str:
    return f"{group.lesion}, {group.observer} observer"


def _chart(results: Results, group: Found) -> Chart:
    lines = []
    for _, task in group.tasks:
        # What has no logarithm is in the table alone.
        found = {p.tube_current_ma: d for p in task.points if (d := p.found.d_prime).estimate > 0}
        values, ends = [d.estimate for d in found.values()], [(d.low, d.high) for d in found.values()]
        look = results.label(task.method), results.colour(task.method)
        lines.append(Line(*look, [*found], values, ends, dashed=task.method in results.controls))
    says = f"Detectability over tube current for {_title(group)}; numbers are in the table below."
    return line_chart(_title(group), lines, axes=("tube current, mA", "d′"), says=says, log=True)
