"""Walk a user's way through pnpct: run the commands of a text in an empty folder, and compare what they print.

    python tests/walks/walk.py tests/walks/physicist.txt ...

A line that begins with "$ " is a command for the shell, and "> " goes on with it; what follows, up to an empty line, is
what it prints, with "..." for anything. The pnpct is the one that is installed with
this Python.
"""

import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from doctest import ELLIPSIS, NORMALIZE_WHITESPACE, OutputChecker
from pathlib import Path

STEP = re.compile(r"^\$ (.*(?:\n>.*)*)((?:\n(?!\$ ).+)*)", re.MULTILINE)


def steps(text: str) -> Iterator[tuple[str, str]]:
    """Yield each command and what it shall print."""
    for command, printed in STEP.findall(text):
        yield re.sub(r"\n> ?", "\n", command), printed.lstrip("\n")


def walk(path: Path, folder: Path) -> list[str]:
    """Run the commands in a folder, and say what went otherwise."""
    here = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    surroundings = {**os.environ, "PATH": here, "NO_COLOR": "1", "COLUMNS": "120"}
    wrong = []
    for command, wanted in steps(path.read_text(encoding="utf-8")):
        start = time.perf_counter()
        done = subprocess.run(
            ["bash", "-c", command],
            cwd=folder,
            env=surroundings,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL,
            text=True,
            encoding="utf-8",
        )
        print(f"{time.perf_counter() - start:6.1f} s  $ {command.partition(chr(10))[0]}", flush=True)
        if not OutputChecker().check_output(wanted, done.stdout.strip(), ELLIPSIS | NORMALIZE_WHITESPACE):
            wrong.append(f"{path.name}: $ {command}\nwas to print\n{wanted}\nand printed\n{done.stdout}")
    return wrong


def main() -> None:
    """Walk through all that are named."""
    wrong = []
    for name in sys.argv[1:]:
        with tempfile.TemporaryDirectory() as folder:
            wrong += walk(Path(name).resolve(), Path(folder))
    sys.exit("\n\n".join(wrong) or None)


if __name__ == "__main__":
    main()
