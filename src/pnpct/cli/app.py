"""The program `pnpct`: finds the command, and turns an error into one line.

Only what a command needs is imported: nobody waits for a library to see the list of the commands.
"""

import ctypes
import difflib
import gc
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from importlib.metadata import version
from typing import Any

from pnpct.cli.signals import ended_as_by_ctrl_c
from pnpct.cli.terminal import complain, say

COMMANDS = {
    "simulate scan": "Simulate a scan of one slice.",
    "simulate dataset": "Simulate a data set of many patients, without noise.",
    "simulate draw": "Draw a noisy scan from a slice of a data set.",
    "import arrays": "Make a scan from NumPy or MATLAB files of counts or line integrals.",
    "import catsim": "Make a scan from the raw files of CatSim.",
    "import dicom-ct-pd": "Make a scan from clinical projection data in DICOM.",
    "train": "Train a denoiser on simulated scans, on a single scan, or on your own images.",
    "reconstruct": "Reconstruct the image or the volume of a scan.",
    "denoise": "Denoise an image or a volume.",
    "evaluate": "Compare an image or a volume with the truth.",
    "measure": "Measure noise, sharpness and detectability on images of a phantom.",
    "report": "Show a comparison as an HTML page, and its images as a figure.",
    "view": "Write a volume as an HTML page to scroll through.",
    "compare": "Compare the methods of the paper, and your own, on the same scans.",
    "info": "Describe a scan or an image.",
    "doctor": "Describe this installation, for a bug report.",
    "completion": "Write a completion script for bash, zsh or fish.",
    "demo": "Simulate, reconstruct and evaluate a low-dose slice, in minutes.",
}
"""The commands, each in the module of its name with _ between words, which is imported only when it is needed."""

_OUT_OF_MEMORY = ("out of memory", "can't allocate memory", "Storage size calculation overflowed")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the program.

    Args:
        argv: The arguments after the program's name; those of this process if None.

    Returns:
        The exit status: 0, 2 after an error that one line on stderr has explained, 130 after Ctrl-C, SIGTERM
        or SIGHUP. An exception that is raised from here is a bug.
    """
    # By default PyTorch's threads go on spinning for milliseconds after their work, on the cores that the projector's
    # threads then need; asleep at once, they are woken too late. It is read when PyTorch is loaded.
    os.environ.setdefault("GOMP_SPINCOUNT", "1000")
    _keep_freed_memory()
    try:
        with ended_as_by_ctrl_c():
            run(list(sys.argv[1:] if argv is None else argv))
        sys.stdout.flush()
    except KeyboardInterrupt:
        complain("interrupted.")
        return 130
    except BrokenPipeError:
        _give_up_stdout()  # the reader of stdout has closed it
    except SystemExit as leave:
        return int(leave.code or 0)  # tyro has shown its help
    except (ModuleNotFoundError, OSError, ValueError) as error:
        complain(_sentence(error))
        _give_up_stdout()
        return 2
    except (MemoryError, RuntimeError, SystemError) as error:
        # A SystemError is what is left of a MemoryError that a library has dropped.
        if isinstance(error, RuntimeError) and not any(words in str(error) for words in _OUT_OF_MEMORY):
            raise
        complain("out of memory; use fewer pixels or a larger machine.")
        return 2
    return 0


def _keep_freed_memory() -> None:
    """Have this process, and those it starts, take arrays from memory that others have left, not from the system.

    The GNU C library gives arrays of megabytes back at once and takes them anew, page by page: a fifth of the time of a
    network, in which they come and go. Other libraries stay as they are.
    """
    settings = {"MALLOC_MMAP_MAX_": (-4, 0), "MALLOC_TRIM_THRESHOLD_": (-1, 2**31 - 1)}
    if sys.platform != "linux" or not hasattr(library := ctypes.CDLL(None), "mallopt"):
        return
    for variable, (parameter, value) in settings.items():
        if variable not in os.environ:  # else the library has read it
            os.environ[variable] = str(value)
            library.mallopt(parameter, value)


def run(words: Sequence[str]) -> None:
    """Run one command, or list the commands, as `main` does; errors are raised.

    Args:
        words: The arguments after the program's name.
    """
    first = words[0] if words else "--help"
    if first in ("-h", "--help"):
        say(_overview(COMMANDS))
    elif first == "--version":
        say(version("pnpct"))
    elif (group := group_of(first)) and (len(words) == 1 or words[1] in ("-h", "--help")):
        say(_overview(group))
    else:
        command, rest = _find(words)
        from pnpct.cli.parsing import parse

        asked = parse(class_of(command), rest, program=f"pnpct {command}")
        with import_module("numpy").errstate(over="ignore"):  # what becomes infinite is refused where a value is born
            asked.run(["pnpct", *words])


def class_of(command: str) -> Any:
    """Return the dataclass of one of the `COMMANDS`, whose fields are its arguments."""
    words = command.replace("-", " ").split()
    with _no_garbage_collected():
        module = import_module(f"pnpct.cli.{'_'.join(words)}")
    return getattr(module, "".join(map(str.title, words)))


@contextmanager
def _no_garbage_collected() -> Iterator[None]:
    """Let the many objects of large libraries come without a search for garbage among them, and never again."""
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()


def _find(words: Sequence[str]) -> tuple[str, Sequence[str]]:
    """The command that the arguments begin with, and the other arguments."""
    for length in (1, 2):
        if (command := " ".join(words[:length])) in COMMANDS:
            return command, words[length:]
    group = group_of(words[0])
    place = 1 if group else 0
    before, asked = words[:place], words[place]
    names = {command.split()[place] for command in group or COMMANDS}
    near = difflib.get_close_matches(asked, names, n=1, cutoff=0.7)
    instead = f"did you mean {' '.join([*before, *near])}?" if near else f"there are {', '.join(group or COMMANDS)}."
    raise ValueError(f'There is no command "{" ".join([*before, asked])}"; {instead}')


def group_of(word: str) -> list[str]:
    """Return the commands of the group of this name."""
    return [command for command in COMMANDS if command.startswith(f"{word} ")]


def _overview(commands: Sequence[str] | dict[str, str]) -> str:
    lines = [f"  {command:18} {COMMANDS[command]}" for command in commands]
    return "\n".join(
        [
            "usage: pnpct COMMAND ...",
            "",
            "Plug-and-play reconstruction for low-dose CT.",
            "",
            *lines,
            "",
            "pnpct COMMAND --help explains a command; pnpct --version prints the version.",
        ]
    )


def _give_up_stdout() -> None:
    """Drop the lines that cannot be written, so that the interpreter does not try again when it ends."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _sentence(error: Exception) -> str:
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename or 'the output'}: {error.strerror}."
    return str(error)
