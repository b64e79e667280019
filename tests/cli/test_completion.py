"""What shells complete with the scripts of `pnpct completion`: asked as a user does, by Tab."""

import os
import re
import select
import shutil
import subprocess
import time
from pathlib import Path

import pytest

from pnpct.cli.app import COMMANDS

TYPED = {
    "pnpct rec": "pnpct reconstruct ",
    "pnpct simulate s": "pnpct simulate scan ",
    "pnpct import dic": "pnpct import dicom-ct-pd ",
    "pnpct simulate scan new.h5 --anat": "pnpct simulate scan new.h5 --anatomy ",
    "pnpct reconstruct my": "pnpct reconstruct my-scan.h5 ",
    "pnpct reconstruct --kernel ha": "pnpct reconstruct --kernel hann ",
    "pnpct reconstruct my-scan.h5 a.h5 --kernel ha": "pnpct reconstruct my-scan.h5 a.h5 --kernel hann ",
    "pnpct train set a.safetensors --reference noi": "pnpct train set a.safetensors --reference noise-free ",
}
SHELLS = {
    "bash": (["bash", "--norc", "-i"], ""),
    "zsh": (["zsh", "-f", "-i"], "autoload -U compinit && compinit -u -D; "),
}


@pytest.fixture
def script(request, run, tmp_path: Path) -> Path:
    """The script for a shell that is installed, in a folder with a scan."""
    if not shutil.which(request.param):
        pytest.skip(f"{request.param} is not installed")
    (tmp_path / "my-scan.h5").touch()
    status, out, err = run("completion", request.param)
    assert (status, err) == (0, "")
    path = tmp_path / f"pnpct.{request.param}"
    path.write_text(out)
    return path


@pytest.mark.parametrize("script", SHELLS, indirect=True)
def test_tab_completes(script):
    pty = pytest.importorskip("pty", reason="this system has no pseudo-terminals")
    words, before = SHELLS[script.suffix[1:]]
    terminal, other_end = pty.openpty()
    environment = {**os.environ, "TERM": "dumb", "INPUTRC": os.devnull, "HISTFILE": os.devnull}
    shell = subprocess.Popen(
        words,
        **dict.fromkeys(("stdin", "stdout", "stderr"), other_end),
        cwd=script.parent,
        env=environment,
        start_new_session=True,
    )
    os.close(other_end)
    try:
        os.write(terminal, f"{before}source {script}; echo 're''ady'\n".encode())
        shown(terminal, "ready")
        for typed, completed in TYPED.items():
            os.write(terminal, f"{typed}\t".encode())
            shown(terminal, completed)
            os.write(terminal, b"\x15")  # clears the line
    finally:
        shell.kill()
        shell.wait()
        os.close(terminal)


def shown(terminal: int, text: str) -> None:
    """Wait until a terminal has shown a text."""
    out, end = "", time.monotonic() + 20
    while text not in out:
        assert select.select([terminal], [], [], max(0, end - time.monotonic()))[0], f"{text!r} not in {out!r}"
        out += os.read(terminal, 4096).decode(errors="replace")


@pytest.mark.parametrize("script", ["fish"], indirect=True)
def test_fish_completes(script):
    for typed, completed in TYPED.items():
        asked = ["fish", "--no-config", "-c", f"source {script}; complete -C '{typed}'"]
        done = subprocess.run(asked, cwd=script.parent, capture_output=True, text=True, check=True)
        assert done.stdout.split() == [completed.split()[-1]], done.stderr


@pytest.mark.parametrize("script", ["bash"], indirect=True)
def test_the_options_are_those_of_the_help(script, run, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    for command in COMMANDS:
        _, out, _ = run(*command.split(), "--help")
        words = f"COMP_WORDS=(pnpct {command} -); COMP_CWORD={1 + len(command.split())}"
        asked = ["bash", "-c", f"source {script}; {words}; _pnpct; echo ${{COMPREPLY[@]}}"]
        done = subprocess.run(asked, capture_output=True, text=True, check=True)
        assert set(done.stdout.split()) == set(re.findall(r"^[│ ] (?:-h, )?(--[\w-]+)", out, re.MULTILINE)), command
