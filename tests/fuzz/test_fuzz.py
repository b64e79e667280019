"""Damaged files of every kind that is read: one sentence, nothing left behind, bounded time and memory."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from readers import READERS

HERE = Path(__file__).parent
FEW, MANY = 12, int(os.environ.get("PNPCT_MUTATIONS", "1000"))


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
    run("-c", MAKE, folder)
    return folder


MAKE = """
import sys
from pathlib import Path
from dicom_images import dicom
from readers import make
from small_comparison import make_comparison
make(Path(sys.argv[1]), make_comparison, dicom)
"""


def check(made: Path, mutations: int, seed: int, *names: str) -> None:
    figures = json.loads(run(HERE / "driver.py", made, mutations, seed, *names))
    wrong = [(name, each) for name, found in figures.items() for each in found["wrong"]]
    assert sum(found["mutations"] for found in figures.values()) == mutations * len(names or READERS)
    assert not wrong, "\n\n".join(
        f"{name} {each['number']} {each['said']}\n" + "\n".join(each["wrong"]) for name, each in wrong
    )


@pytest.mark.slow
def test_a_damaged_file_is_one_sentence(made):
    check(made, FEW, 1)


@pytest.mark.slow
@pytest.mark.parametrize("name", READERS)
def test_many_damaged_files_are_each_one_sentence(made, name):
    check(made, MANY, 2, name)
