"""Rounds in which contenders alternate, what they took, and on which machine."""

import math
import os
import platform
import statistics
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import torch

from contenders import World
from worker import ContenderError, Worker

VERSIONS = ("pnpct", "torch", "numba", "numpy", "astra-toolbox", "svmbir", "torchtomo", "deepinv", "mbirjax", "jax")


@dataclass
class Entry:
    """A contender in a world, and what its parts took.

    Args:
        name: As the tables have it.
        contender: As its worker knows it.
        worker: The process that has it.
        world: What it treats.
        threads: PyTorch threads during a call; peers have those of their worker.
        options: Further arguments of the contender.
        seconds: Of each part, in every round, per slice; filled by `race`.
        answers: What parts answered beside their seconds, the last time.
        failed: Why it has no times; empty if it has.
    """

    name: str
    contender: str
    worker: Worker
    world: World
    threads: int
    options: dict[str, Any] = field(default_factory=dict)
    seconds: dict[str, list[float]] = field(default_factory=dict)
    answers: dict[str, dict[str, Any]] = field(default_factory=dict)
    failed: str = ""

    @property
    def record(self) -> dict[str, Any]:
        """All that was measured, as plain values."""
        known = {"name": self.name, "size": self.world.size, "slices": self.world.slices, "threads": self.threads}
        scan = {"views": self.world.geometry_shape[0], "bins": self.world.geometry_shape[1]}
        return {**known, **scan, "seconds": self.seconds, "answers": self.answers, "failed": self.failed}


def race(entries: Sequence[Entry], rounds: int, *, budget: float, warm_up: bool = True) -> None:
    """Call all entries in turns, once to warm up and then in as many rounds.

    An entry that has used up its budget, s, is out of later rounds, but each has one at least.
    """
    spent, numbers = [0.0] * len(entries), [0] * len(entries)
    for at, entry in enumerate(entries):
        try:
            made = entry.worker.make(entry.contender, entry.world, **entry.options)
            numbers[at] = made["number"]
            entry.seconds = {part: [] for part in made["parts"]}
        except ContenderError as reason:
            entry.failed = str(reason)
    for turn in range(0 if warm_up else 1, rounds + 1):
        for at, entry in enumerate(entries):
            if entry.failed or (turn > 1 and spent[at] > budget):
                continue
            for part, times in entry.seconds.items():
                try:
                    answer = entry.worker.call(numbers[at], part, entry.threads)
                except ContenderError as reason:
                    entry.failed = f"{part}: {reason}"
                    break
                spent[at] += answer["seconds"]
                if turn:  # not that to warm up
                    times.append(answer.pop("seconds") / entry.world.slices)
                    entry.answers[part] = answer
    for worker in {id(entry.worker): entry.worker for entry in entries}.values():
        if worker.alive:
            worker.drop()


def best(record: Mapping[str, Any], *parts: str) -> float:
    """Return the sum of the minima of some parts, s per slice; NaN if one of them was not timed."""
    return sum(min(record["seconds"].get(part) or [math.nan]) for part in parts)


def median(record: Mapping[str, Any], *parts: str) -> float:
    """Return the sum of their medians."""
    return sum(statistics.median(record["seconds"].get(part) or [math.nan]) for part in parts)


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table of Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "".join("| " + " | ".join(cells) + " |\n" for cells in lines)


def number(value: float, digits: int = 3) -> str:
    """Return a number with so many digits that count, and a dash for none."""
    if math.isnan(value):
        return "–"
    exponent = int(f"{value:.{digits - 1}e}".partition("e")[2])
    return f"{value:.{max(0, digits - 1 - exponent)}f}"


def machine(threads: int) -> dict[str, Any]:
    """Return what the times depend on: processor, cores, memory, date, load and versions."""
    return {
        "date": time.strftime("%Y-%m-%d %H:%M %Z"),
        "processor": _processor(),
        "cores": os.cpu_count(),
        "threads": threads,
        "vectors": torch.backends.cpu.get_cpu_capability(),
        "memory_gib": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30, 1),
        "load": [round(load, 2) for load in os.getloadavg()],
        "system": platform.platform(),
        "python": platform.python_version(),
        "versions": {name: found for name in VERSIONS if (found := _version(name))},
    }


def machine_line(found: dict[str, Any]) -> str:
    """Return it as one sentence or two of Markdown."""
    versions = ", ".join(f"{name} {number}" for name, number in found["versions"].items())
    return (
        f"{found['date']}: {found['cores']} cores of {found['processor']} ({found['vectors']}), "
        f"{found['memory_gib']} GiB, {found['threads']} threads, load at the start {found['load'][0]}. "
        f"Python {found['python']}, {versions}.\n"
    )


def available_gigabytes() -> float:
    """Return the memory that is free now."""
    for line in Path("/proc/meminfo").read_text().splitlines():
        if line.startswith("MemAvailable"):
            return int(line.split()[1]) / 2**20
    return float("inf")


def _processor() -> str:
    lines = Path("/proc/cpuinfo").read_text().splitlines() if Path("/proc/cpuinfo").exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor()


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return ""
