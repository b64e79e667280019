"""The walks with the package that is installed here; `make dist` goes them with the wheel in a new environment."""

import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent


@pytest.mark.slow
@pytest.mark.parametrize("text", sorted(HERE.glob("*.txt")), ids=lambda path: path.stem)
def test_what_each_step_prints_is_as_written(text):
    done = subprocess.run([sys.executable, HERE / "walk.py", text], capture_output=True, text=True, encoding="utf-8")
    assert done.returncode == 0, done.stderr
