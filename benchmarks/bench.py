"""Time pnpct, its peers and its own last state, interleaved in one run; write a folder with the figures.

    make bench [BENCH="--rounds 7 --against v0.1.0"]
    python benchmarks/bench.py FOLDER [--quick] [--against REVISION] [--full] [--docs]

Projector, adjoint and FBP from 128 x 128 to 1024 x 1024 pixels and from 1 to 64 slices; a data step and the whole of
plug-and-play at 256 x 256; on one thread, what each part costs and what the machine could do. Peers that are installed
(`make bench` makes a virtual environment with all of them) run in processes of their own; of others the tables say so.
FOLDER gets `bench.json` with every time of every round, `tables.md` and `bench.png`. Nothing else may run meanwhile.
svmbir builds its system matrix once for each scan, some minutes at 256 x 256 and a quarter of an hour at 512 x 512,
which only `--full` asks for.
"""

import argparse
import contextlib
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import torch

import cost_model
import parts
from bench_report import write_docs, write_report
from contenders import PEERS, Contender, World
from interleaved import Entry, available_gigabytes, best, machine, race
from loops import LOOPS
from tasks import write_scan
from worker import Worker

SLICES = (1, 2, 8, 64)
"""Of pnpct; peers have one: none of them treats several slices of a fan beam in less than their sum."""

LONGEST = 50.0
"""Seconds that one round of a peer may take; eight times that of half the size tells."""

LARGEST = 512
"""Rows and columns up to which peers are timed."""

SHARE = 0.5
"""Of the free memory, for one contender."""

SEVERAL = {"torchtomo FBP": 8}
"""Slices of those that are faster with several."""


class Pool:
    """A worker for each package, started at its first use and again when it has died."""

    def __init__(self, threads: int, sources: dict[str, Path]) -> None:
        self._threads, self._sources, self._workers = threads, sources, dict[str, Worker]()

    def __getitem__(self, package: str) -> Worker:
        if package not in self._workers or not self._workers[package].alive:
            self._workers[package] = Worker(threads=self._threads, source=self._sources.get(package))
        return self._workers[package]

    def close(self) -> None:
        for worker in self._workers.values():
            worker.close()


def projectors(pool: Pool, options: argparse.Namespace, threads: int) -> list[dict[str, Any]]:
    """Race the projectors, size by size."""
    records: list[dict[str, Any]] = []
    for size in (64, 128) if options.quick else (128, 256, 512, 1024):
        entries = []
        for slices in (1, 8) if options.quick else SLICES:
            entries.append(Entry("pnpct", "pnpct", pool["pnpct"], World(size, slices), threads))
            if slices in (1, 8) and (options.quick or size == 512):
                entries.append(Entry("pnpct, 1 thread", "pnpct", pool["pnpct"], World(size, slices), 1))
            if slices in (1, 8) and options.against:
                name = f"pnpct at {options.against}"
                entries.append(Entry(name, "pnpct", pool["against"], World(size, slices), threads))
        for name, peer in PEERS.items():
            entry = Entry(name, name, pool[peer.module], World(size, SEVERAL.get(name, 1)), threads)
            before = [record for record in records if record["name"] == name and record["size"] == size // 2]
            entry.failed = left_out(peer, entry.world, before, full=options.full)
            entries.append(entry)
        say(f"projectors, {size} × {size}")
        race([entry for entry in entries if not entry.failed], options.rounds, budget=options.budget)
        records += [entry.record for entry in entries]
    return records


def left_out(peer: Contender, world: World, before: list[dict[str, Any]], *, full: bool = False) -> str:
    """Return why a peer does not take part in a world; nothing if it does."""
    if world.size > LARGEST:
        return f"timed up to {LARGEST} × {LARGEST}"
    needed = peer.gigabytes * world.slices * (world.size / 512) ** 3
    if needed > SHARE * available_gigabytes():
        return f"needs about {needed:.0f} GB"
    if peer.module == "svmbir" and world.size > 256 and not full:
        return "its matrix is built for --full only"
    for record in before:
        round_of_it = sum(best(record, part) for part in record["seconds"]) * record["slices"]
        if record["failed"] or 8 * round_of_it > LONGEST:
            return record["failed"] or f"would take more than {LONGEST:.0f} s a round"
    return ""


def loops(pool: Pool, options: argparse.Namespace, threads: int) -> list[dict[str, Any]]:
    """Race whole plug-and-play and its data step."""
    world = World(64, field=250.0) if options.quick else World(512) if options.full else World(256, field=250.0)
    scan = options.folder / "scan.npz"
    write_scan(world, scan)
    given = {"file": str(scan.resolve()), "patience": 5.0 if options.quick else options.patience}
    entries = []
    for name, contender in LOOPS.items():
        entry = Entry(contender.distribution, name, pool[contender.module], world, threads, given)
        entry.failed = left_out(contender, world, [], full=options.full)
        entries.append(entry)
    if options.against:
        entries.append(Entry(f"pnpct at {options.against}", "pnpct loop", pool["against"], world, threads, given))
    say(f"plug-and-play, {world.size} × {world.size}")
    race([entry for entry in entries if not entry.failed], options.rounds, budget=options.budget, warm_up=False)
    scan.unlink()
    return [entry.record for entry in entries]


@contextlib.contextmanager
def checked_out(revision: str) -> Iterator[Path]:
    """Check a revision of this repository out for a while, and return the folder of its package."""
    root = Path(__file__).parents[1]
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "tree"
        subprocess.run(["git", "-C", root, "worktree", "add", "--quiet", "--detach", target, revision], check=True)
        try:
            yield target / "src"
        finally:
            subprocess.run(["git", "-C", root, "worktree", "remove", "--force", target], check=True)


def say(what: str) -> None:
    print(what, flush=True)


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--quick", action="store_true", help="small sizes, two rounds: says that it runs, not how fast")
    parser.add_argument("--rounds", type=int, help="after one to warm up; 5, or 2 if quick")
    parser.add_argument("--budget", type=float, default=15.0, help="s of a contender, after which later rounds go on")
    parser.add_argument("--patience", type=float, default=90.0, help="s that a peer's plug-and-play has")
    parser.add_argument("--against", default="", help="revision of this repository to run too, the last release")
    parser.add_argument("--full", action="store_true", help="svmbir and plug-and-play at 512 x 512 too")
    parser.add_argument("--docs", action="store_true", help="put the tables into the documents")
    options = parser.parse_args(arguments)
    options.rounds = options.rounds or (2 if options.quick else 5)
    options.folder.mkdir(parents=True, exist_ok=True)
    threads = torch.get_num_threads()
    found: dict[str, Any] = {"machine": machine(threads), "quick": options.quick, "rounds": options.rounds}
    with contextlib.ExitStack() as stack:
        source = {"against": stack.enter_context(checked_out(options.against))} if options.against else {}
        pool = Pool(threads, source)
        stack.callback(pool.close)
        found["projectors"] = projectors(pool, options, threads)
        found["loops"] = loops(pool, options, threads)
    say("cost model")
    found["cost"] = cost_model.measure(options.quick)
    found["parts"] = parts.measure(options.quick)
    write_report(found, options.folder)
    if options.docs:
        write_docs(found, options.folder)


if __name__ == "__main__":
    main()
