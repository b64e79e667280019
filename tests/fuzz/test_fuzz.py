"""Damaged files of every kind that is read: one sentence, nothing left behind, bounded time and memory."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import driver
import pytest
from readers import QUICK, READERS, make

HERE = Path(__file__).parent
PART = 50
"""Mutations in one process: each picture of panels that matplotlib draws leaves 32 MB behind."""
FEW, SOME, MANY = 5, 12, int(os.environ.get("PNPCT_MUTATIONS", "1000"))


def run(*words: object) -> str:
    """Run a program here with the source beside it."""
    folders = [HERE, HERE.parents[1] / "src", HERE.parent / "report", HERE.parent / "files"]
    path = os.pathsep.join([*map(str, folders), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, *map(str, words)],
        env={**os.environ, "PYTHONPATH": path, "OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("good")
    run(HERE / "readers.py", folder)
    return folder


def check(figures: dict[str, Any], mutations: int, names: Sequence[str]) -> None:
    wrong = [(name, each) for name, found in figures.items() for each in found["wrong"]]
    assert sum(found["mutations"] for found in figures.values()) == mutations * len(names)
    assert not wrong, "\n\n".join(
        f"{name} {each['number']} {each['said']}\n" + "\n".join(each["wrong"]) for name, each in wrong
    )


def test_a_damaged_file_is_one_sentence(tmp_path):
    make(tmp_path)
    before = signal.getsignal(signal.SIGALRM)
    check(driver.run(tmp_path, FEW, 1, QUICK), FEW, QUICK)
    signal.signal(signal.SIGALRM, before)


@pytest.mark.slow
def test_a_damaged_file_of_any_kind_is_one_sentence(made):
    check(json.loads(run(HERE / "driver.py", made, SOME, 1)), SOME, list(READERS))


@pytest.mark.slow
@pytest.mark.parametrize("name", READERS)
def test_many_damaged_files_are_each_one_sentence(made, name):
    for first in range(0, MANY, PART):
        part = min(PART, MANY - first)
        check(json.loads(run(HERE / "driver.py", made, part, 2 + first, name)), part, [name])
