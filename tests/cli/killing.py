"""The program as a process that can be killed, and what it leaves."""

import os
import subprocess
import sys
from pathlib import Path

ENVIRONMENT = os.environ | {"OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
PROGRAM = [
    sys.executable,
    "-c",
    # nohup and & let both be ignored
    "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler); "
    "signal.signal(signal.SIGHUP, signal.SIG_DFL); "
    "from pnpct.cli import main; sys.exit(main())",
]


def start(words, **options):
    """The program, as a process with a group of its own."""
    words = [*PROGRAM, *map(str, words)]
    piped = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen(words, env=ENVIRONMENT, start_new_session=True, **piped, **options)


def finish(words, **options):
    with start(words, **options) as process:
        out, err = process.communicate(timeout=300)
    assert process.returncode == 0, out + err


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
