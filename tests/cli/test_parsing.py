"""What tyro finds wrong, as a sentence, on terminals of all kinds."""

import io
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import pytest
from tyro.conf import Positional

from pnpct.cli.parsing import UsageError, option, parse


@dataclass(frozen=True)
class Command:
    """Do something."""

    source: Positional[Path]
    target: Positional[Path]
    size: int = 3
    weight: float = 1.0
    ratio: float | None = None
    choice: Annotated[Literal["red", "green"] | None, option(default="red")] = None


@pytest.mark.parametrize("encoding", ["utf-8", "ascii"])
@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ("", "missing: SOURCE, TARGET."),
        ("a", "missing: TARGET."),
        ("a b --size", "Missing value for argument '--size'. Expected 1 values."),
        ("a b --size one", "--size needs a whole number, got 'one'."),
        ("a b --weight x", "--weight needs a number, got 'x'."),
        ("a b --ratio x", "--ratio needs a number, got 'x'."),
        ("a b --heavy", "There is no option --heavy."),
        ("a b --sizes 3", "There is no option --sizes; did you mean --size?"),
        ("a b --wieght=2", "There is no option --wieght; did you mean --weight?"),
        ("a b --sorce c", "There is no option --sorce."),  # SOURCE is not an option
        ("a b c d", "Too many arguments: c, d."),
        ("a b --choice blue", "invalid choice 'blue' for argument '--choice'. Expected one of"),
    ],
)
def test_a_mistake_becomes_one_sentence(words, sentence, encoding, monkeypatch, capsys):
    monkeypatch.setattr("sys.stdout", io.TextIOWrapper(io.BytesIO(), encoding=encoding))
    with pytest.raises(UsageError) as raised:
        parse(Command, words.split(), program="pnpct do")
    assert str(raised.value).startswith(sentence)
    assert str(raised.value).endswith((". See pnpct do --help.", "? See pnpct do --help."))
    assert "None" not in str(raised.value)
    assert capsys.readouterr().err == ""
    assert sys.stdout.tell() == 0


def test_what_is_given_is_taken():
    assert parse(Command, ["a", "b", "--size", "5", "--choice", "green"], program="pnpct do") == Command(
        Path("a"), Path("b"), size=5, choice="green"
    )
    assert parse(Command, ["--weight", "-2e-3", "a", "b"], program="pnpct do").weight == -0.002
