"""From arguments to a command, by its annotations and its docstring."""

import difflib
import io
import re
from collections.abc import Iterable, Sequence
from contextlib import redirect_stderr
from dataclasses import fields
from typing import Any, TypeVar

import tyro

Command = TypeVar("Command")


class UsageError(ValueError):
    """The command line is not valid."""


def option(*, default: object = None, metavar: str | None = None) -> Any:
    """Annotate an option.

    Args:
        default: Default that the help shows for an option that is None when it is not given.
        metavar: What the help shows for its value.
    """
    hint = None if default is None else f"(default: {default})"
    return tyro.conf.arg(help_behavior_hint=hint, metavar=metavar)


def given_options(command: object, names: Iterable[str]) -> dict[str, Any]:
    """Return the options of a command that were given, by name: those that are neither None nor a flag left out."""
    values = {name: getattr(command, name) for name in names}
    return {name: value for name, value in values.items() if value is not None and value is not False}


def parse(command: type[Command], words: Sequence[str], *, program: str) -> Command:
    """Make a command from the arguments that follow its name.

    Args:
        command: A dataclass with a docstring that explains its fields.
        words: The arguments.
        program: The program and command before them.

    Raises:
        UsageError: If an argument is unknown, missing or invalid.
        SystemExit: After the help was shown.
    """
    complaint = io.StringIO()
    markers = (tyro.conf.DisallowNone, tyro.conf.PositionalMetavarFromFieldName)
    try:
        with redirect_stderr(complaint):
            parsed, unknown = tyro.cli(command, prog=program, args=words, config=markers, return_unknown_args=True)
    except SystemExit as leave:
        if not leave.code:
            raise
        raise UsageError(f"{_unboxed(complaint.getvalue())} See {program} --help.") from None
    if unknown:
        raise UsageError(f"{_unknown(unknown, command)} See {program} --help.")
    return parsed


def _unknown(words: Sequence[str], command: type[Any]) -> str:
    """The sentence on arguments that a command does not have, which names the option next to a mistyped one."""
    mistyped = next((word.split("=")[0] for word in words if word.startswith("-")), None)
    if mistyped is None:
        return f"Too many arguments: {', '.join(words)}."
    near = difflib.get_close_matches(mistyped.lstrip("-"), [name[2:] for name in options_of(command)], n=1)
    return f"There is no option {mistyped}{f'; did you mean --{near[0]}?' if near else '.'}"


def options_of(command: type[Any]) -> dict[str, Any]:
    """Return the options of a command, as they are typed, and the type of each."""
    others = {tyro.conf.Positional, tyro.conf.Suppress}
    named = [field for field in fields(command) if others.isdisjoint(getattr(field.type, "__metadata__", ()))]
    return {f"--{field.name.replace('_', '-')}": field.type for field in named}


def _unboxed(complaint: str) -> str:
    """The message in a box that tyro has drawn, without its title and what follows the first line across."""
    plain = re.sub(r"\x1b\[[0-9;]*m", "", complaint)
    rows = [re.sub(r"^[│ ]|│$", "", row).rstrip() for row in plain.splitlines()[1:]]
    across = [number for number, row in enumerate(rows) if row and not row.strip(" ─-")]
    # Where a terminal has no lines to draw with, the title is underlined.
    first = 1 if across[:1] == [0] else 0
    message = rows[first : next((number for number in across if number >= first), len(rows))]
    if message[:1] and message[0].startswith(" Missing from"):
        # Then follow the names, four spaces in, and their help, eight.
        names = [row.strip() for row in message if re.match(r" {5}\S", row)]
        return f"missing: {', '.join(names)}."
    text = " ".join(" ".join(message).split()).removeprefix("Error parsing ")
    # tyro's order of the choices is that of a set, and None is what an option is that was not given.
    text = re.sub(r"\(('.*')\)", lambda found: ", ".join(sorted({*found[1].split(", ")} - {"'None'"})), text)
    text = re.sub(r": no type matching (\S+) could be instantiated from \[(.*?)\]\..*", r" needs \1, got \2.", text)
    text = re.sub(r": invalid literal for int\(\) with base 10: (.*)", r" needs INT, got \1.", text)
    text = re.sub(r": could not convert string to float: (.*)", r" needs FLOAT, got \1.", text)
    text = text.replace(" needs INT,", " needs a whole number,").replace(" needs FLOAT,", " needs a number,")
    return text if text.endswith(".") else text + "."
