"""Run commands of pnpct on damaged files, in a process of its own, and write what was not as it must be.

    python driver.py FOLDER MUTATIONS SEED [READER ...]

FOLDER has been filled by `readers.make`. Each command must end with status 0 or 2 within five seconds of this
process's work, say one line on stderr after a mistake and nothing else, leave nothing behind but what a success has
written, leave its inputs as they were, and need no more than two GiB beside what is loaded already.
"""

import io
import json
import os
import random
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Iterable
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

import torch
from mutations import of_bytes, of_place
from readers import READERS, Reader

from pnpct.cli import main

SECONDS = 5.0
BLOCKED_AFTER = 600
"""Seconds of the clock: other work on the machine may stop this one for a while."""

MEMORY = 2 << 30


class Blocked(BaseException):
    """A command did not end."""


def say_blocked(*_: object) -> None:
    raise Blocked


def run_one(reader: Reader, made: Path, seed: str) -> tuple[str, int | None, list[str]]:
    """Damage a copy of a reader's files, run its command, and return what was done, the status, and what was wrong."""
    chance = random.Random(seed)
    with tempfile.TemporaryDirectory(prefix="fuzz") as name:
        here = Path(name)
        for each in reader.files:
            source = made / each
            (shutil.copytree if source.is_dir() else shutil.copy)(source, here / each)
        damaged = chance.choice(reader.damaged)
        target = here / damaged
        if target.is_dir():
            target = chance.choice(sorted(path for path in target.rglob("*") if path.is_file()))
        mutate = chance.choice((of_bytes, of_place, *reader.mutations[target.suffix] * 6))
        said = f"{target.relative_to(here)}: {mutate(target, chance)}"
        commands = [command for command in reader.commands if f"/{damaged}" in command] or reader.commands
        words = [word.format(here=here, made=made) for word in chance.choice(commands).split()]
        (here / "out").mkdir()
        before = listed(here)
        out, err = io.StringIO(), io.StringIO()
        began, wrong = time.process_time(), []
        signal.alarm(BLOCKED_AFTER)
        try:
            with redirect_stdout(out), redirect_stderr(err):
                status = main(words)
        except Blocked:
            return said, None, [f"it did not end in {BLOCKED_AFTER} s"]
        except BaseException:  # what is sought
            return said, None, [traceback.format_exc(limit=-6)]
        finally:
            signal.alarm(0)
        seconds, complaint = time.process_time() - began, err.getvalue()
        if status not in (0, 2):
            wrong.append(f"status {status}")
        if status == 2 and not (
            complaint.startswith("pnpct: ") and complaint.count("\n") == 1 and len(complaint) < 1100
        ):
            wrong.append(f"complaint {complaint[:300]!r} of {len(complaint)} letters")
        if status == 2 and any(words in complaint for words in FOREIGN):
            wrong.append(f"a sentence of a library: {complaint[:400]}")
        if status == 0 and complaint:
            wrong.append(f"success that complains: {complaint[:300]!r}")
        if seconds > SECONDS:
            wrong.append(f"{seconds:.1f} s")
        after = listed(here)
        if any(after.get(path) != of for path, of in before.items()):
            wrong.append("an input has changed")
        new = [path for path in after if path not in before]
        if new and status:
            wrong.append(f"left behind: {new}")
        if any(Path(path).name.startswith(".") for path in new):
            wrong.append(f"temporary files: {new}")
        return said, status, wrong


FOREIGN = (
    "zip() argument",
    "cannot write empty",
    "not enough values to unpack",
    "object is not",
    "list index",
    "truth value",
)
"""Sentences that are for programmers."""


def listed(folder: Path) -> dict[str, tuple[int, int]]:
    """Everything below a folder, with size and time."""
    found = {}
    for path in sorted(folder.rglob("*")):
        state = path.lstat()
        found[str(path.relative_to(folder))] = (0, 0) if path.is_dir() else (state.st_size, state.st_mtime_ns)
    return found


def limit_memory() -> None:
    """Let this process have so much more than it has."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    resource.setrlimit(resource.RLIMIT_AS, (pages * os.sysconf("SC_PAGE_SIZE") + MEMORY, resource.RLIM_INFINITY))


def run(made: Path, mutations: int, seed: int, names: Iterable[str]) -> dict[str, Any]:
    """Run readers and return figures, by reader."""
    signal.signal(signal.SIGALRM, say_blocked)
    figures: dict[str, Any] = {}
    for name in names:
        reader = READERS[name]
        for command in reader.commands:  # undamaged, so that what is compiled and cached is so before the clock runs
            with tempfile.TemporaryDirectory() as here, redirect_stdout(io.StringIO()):
                (Path(here) / "out").mkdir()
                for each in reader.files:
                    (shutil.copytree if (made / each).is_dir() else shutil.copy)(made / each, Path(here) / each)
                if status := main([word.format(here=here, made=made) for word in command.split()]):
                    raise SystemExit(f"{name} fails undamaged with {status}")
        if __name__ == "__main__" and sys.platform == "linux" and not figures:
            limit_memory()
        ended = {0: 0, 2: 0}
        found = []
        for number in range(mutations):
            said, status, wrong = run_one(reader, made, f"{name} {seed} {number}")
            if wrong:
                found.append({"number": number, "said": said, "wrong": wrong})
            else:
                ended[status] += 1
        figures[name] = {"mutations": mutations, "refused": ended[2], "read": ended[0], "wrong": found}
    return figures


if __name__ == "__main__":
    folder, mutations, seed, *names = sys.argv[1:]
    torch.set_num_threads(1)
    sys.stdout.write(json.dumps(run(Path(folder), int(mutations), int(seed), names or READERS), indent=1))
