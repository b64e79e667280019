"""How the program behaves as a process: help, Ctrl-C, closed pipes."""

import os
import re
import signal
import subprocess
import sys
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import get_args, get_type_hints

import pytest
from mistakes import contents

from pnpct.cli.app import COMMANDS, class_of
from pnpct.cli.denoiser_options import DENOISER_OPTIONS
from pnpct.cli.options import MethodOptions
from pnpct.cli.volume_options import VOLUME_OPTIONS
from pnpct.denoisers import DENOISERS
from pnpct.reconstruction import METHODS

GROUPS = {command.split()[0] for command in COMMANDS if " " in command}
PROGRAM = [sys.executable, "-c", "import sys; from pnpct.cli import main; sys.exit(main())"]


@pytest.mark.parametrize("words", [[], ["--help"], ["-h"], ["import"], ["import", "--help"], ["simulate"]], ids=str)
def test_the_overview_says_what_there_is(words, run):
    status, out, err = run(*words)
    assert (status, err) == (0, "")
    shown = [command for command in COMMANDS if not words or words[0] not in GROUPS or command.startswith(words[0])]
    assert all(f"  {command:18} {COMMANDS[command]}" in out for command in shown)


def test_the_version_is_that_of_the_package(run):
    from pnpct import __version__

    assert run("--version") == (0, f"{__version__}\n", "")


def test_the_overview_imports_neither_torch_nor_numba():
    program = "import sys; from pnpct.cli import main; main(['--help']); print(sorted(sys.modules))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    modules = done.stdout.splitlines()[-1]
    assert "'pnpct.cli.app'" in modules
    assert not [heavy for heavy in ("torch", "numba", "h5py", "scipy", "skimage", "rich") if f"'{heavy}'" in modules]


@pytest.mark.parametrize("command", COMMANDS)
def test_the_help_of_a_command_names_each_option_and_its_default(command, run, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    status, out, err = run(*command.split(), "--help")
    assert (status, err) == (0, "")
    chosen = class_of(command)
    assert chosen.__doc__.splitlines()[0] in out
    text = " ".join(re.sub("[│╭╮╰╯]", " ", out).split())
    options = [field for field in fields(chosen) if field.name != "phantoms"]  # which Python alone chooses
    for field in options:
        spelled = (
            f"--{field.name.replace('_', '-')} ",
            f" {field.name.upper()} ",
            f" [{field.name.upper()}] ",
            f"--{field.name.replace('_', '-')}, --no-",
        )
        assert any(words in text for words in spelled), field.name
    assert len(re.findall(r"\(default: |\(required\)|\(repeatable\)", text)) >= len(options)


def test_each_method_option_has_an_effect_on_some_method():
    options = {field.name for field in fields(MethodOptions)} - {"method", *DENOISER_OPTIONS}
    of_methods = set().union(*({field.name for field in fields(method)} for method in METHODS.values()))
    assert options | ({*VOLUME_OPTIONS} & of_methods) == of_methods - {"denoise", "strength"}
    assert get_args(get_type_hints(MethodOptions)["method"]) == tuple(METHODS)


def test_the_help_names_the_denoisers_and_their_units(run, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    for command in ("reconstruct", "denoise"):
        _, out, _ = run(command, "--help")
        text = " ".join(re.sub("[│╭╮╰╯]", " ", out).split())
        assert f"{{n2n,supervised,{','.join(DENOISERS)}}}" in text.replace(", ", ",")
        assert all(f"{name}: {known.usual:g} {known.unit}" in text for name, known in DENOISERS.items())


def test_ctrl_c_while_iterating_gives_130_and_one_line_and_no_file(made, tmp_path):
    words = [
        "reconstruct",
        str(made / "scan.h5"),
        str(tmp_path / "out.h5"),
        *("--method", "tv", "--iterations", "100000", "--stop", "never"),
    ]
    pty = pytest.importorskip("pty", reason="this system has no pseudo-terminals")
    terminal, other_end = pty.openpty()
    # A shell that runs the tests in the background has it ignored, and so would the program.
    heeding = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    process = subprocess.Popen(
        [*PROGRAM, *words], stdout=subprocess.PIPE, stderr=other_end, text=True, preexec_fn=heeding
    )
    os.close(other_end)
    shown = b""
    # The bar shows on the terminal: the second iteration is done.
    while not re.search(rb"[2-9]/100000", shown):
        shown += os.read(terminal, 4096)
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=60)
    try:
        while more := os.read(terminal, 4096):
            shown += more
    except OSError:  # Linux says so at the end
        pass
    os.close(terminal)
    assert process.returncode == 130
    assert out == ""
    assert shown.decode().replace("\r\n", "\n").endswith("pnpct: interrupted.\n")
    assert 0 <= shown.find(b"Preparing") < shown.find(b"ADMM")
    # Above that line only the bar was, which clears its line when it goes.
    assert shown.rfind(b"\x1b[2K") > shown.rfind(b"/100000")
    assert contents(tmp_path) == {}


@pytest.mark.parametrize(
    ("words", "shown"),
    [
        ("reconstruct {made}/scan.h5 {here}/o.h5 --method fbp", "Preparing"),
        ("denoise {made}/image.h5 {here}/series --denoiser gaussian", "Reading Denoising Writing"),
        ("evaluate {made}/image.h5 {made}/scan.h5", "Measuring"),
        ("info {made}/scan.h5", "Views"),
    ],
)
def test_on_a_terminal_each_command_says_what_it_does(words, shown, run, made, tmp_path, monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    status, _, err = run(*words.format(made=made, here=tmp_path).split())
    assert status == 0
    assert [word for word in shown.split() if word not in err] == []


def test_off_a_terminal_no_progress_is_shown(run, made, tmp_path):
    status, out, err = run("reconstruct", made / "scan.h5", tmp_path / "out.h5", "--iterations", "2")
    assert (status, err) == (0, "")
    assert out == f"Wrote {tmp_path / 'out.h5'}: 64 x 64 pixels of 3.906 mm.\n"


def test_who_stops_reading_does_no_harm():
    process = subprocess.Popen([*PROGRAM, "--help"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    process.stdout.close()
    assert process.stderr.read() == ""
    assert process.wait() == 0
    process.stderr.close()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full here")
def test_a_full_disk_under_stdout_gets_one_line():
    with Path("/dev/full").open("w") as full:
        done = subprocess.run([*PROGRAM, "--help"], stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr == "pnpct: the output: No space left on device.\n"


def test_running_out_of_memory_gets_one_line(run, monkeypatch):
    for error in (MemoryError(), RuntimeError("CUDA out of memory. Tried to allocate 2 GiB.")):

        def fail(*_, error=error, **__):
            raise error

        monkeypatch.setattr("pnpct.cli.parsing.parse", fail)
        status, _, err = run("info", "file.h5")
        assert status == 2
        assert err == "pnpct: out of memory; use fewer pixels or a larger machine.\n"
