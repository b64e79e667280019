"""The results of `evaluate`, as a table and as a file."""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

from pnpct.cli.terminal import say
from pnpct.files import atomic_path


def say_scores(columns: Mapping[str, Mapping[str, float | None]]) -> None:
    """Write a table to stdout.

    Args:
        columns: For each image the value of each metric.
    """
    table = Table("", box=box.SIMPLE_HEAD)
    for name in columns:
        table.add_column(name, justify="right")
    for metric in next(iter(columns.values())):
        table.add_row(metric, *(_shown(values[metric]) for values in columns.values()))
    console = Console()
    with console.capture() as written:  # rich itself would end the program when stdout is closed
        console.print(table)
    say(written.get().rstrip())


def _shown(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"


def write_scores(path: Path, scores: Mapping[str, Any]) -> None:
    """Write values by name, or several such tables by name, as JSON; null for infinity, which JSON does not know.

    Raises:
        OSError: If the file cannot be written.
    """
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(_finite(scores), indent=1) + "\n")


def _finite(scores: Mapping[str, Any]) -> dict[str, Any]:
    return {
        name: _finite(value) if isinstance(value, Mapping) else value if value is None or math.isfinite(value) else None
        for name, value in scores.items()
    }
