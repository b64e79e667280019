"""`metrics.csv`: the numbers of a comparison as one long table."""

import csv
from collections.abc import Iterator
from pathlib import Path

from pnpct.comparison.results import Comparison
from pnpct.files import atomic_path

TABLE = "metrics.csv"
"""Name of the file in the folder of a comparison."""

_COLUMNS = ("group", "case", "method", "name", "value")


def write_table(folder: Path, comparison: Comparison) -> None:
    """Write `metrics.csv`: a row for each number, with its group, case, method and name.

    Raises:
        OSError: If the file cannot be written.
    """
    with atomic_path(folder / TABLE) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(_COLUMNS)
        rows.writerows(_rows(comparison))


def _rows(comparison: Comparison) -> Iterator[tuple[object, ...]]:
    for group in ("fidelity", "texture", "histogram"):
        for case, methods in getattr(comparison, group).items():
            for method, numbers in methods.items():
                for name, value in numbers.items():
                    yield group, case, method, name, "" if value is None else value
    for method, features in comparison.texture_change.items():
        for each in features:
            yield "texture change", "", method, each.feature, each.ratio_of_means
    for task in comparison.tasks:
        for point in task.points:
            yield "d'", f"{point.tube_current_ma:g} mA", task.method, f"{task.lesion}, {task.observer}", point.d_prime
    for lesion in comparison.lesions:
        yield "lesion recovered", lesion.case, lesion.method, lesion.lesion, lesion.recovered
    for check in comparison.checks:
        value = "" if check.value is None else check.value
        yield f"check: {check.verdict}", check.case or "", check.method or "", check.name, value
