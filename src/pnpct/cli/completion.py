"""`pnpct completion`: the commands, options and choices, as a script for a shell.

tyro's scripts are not used: they complete no names of files where an argument is one, which is most of what is typed.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args, get_origin

from tyro.conf import Positional

from pnpct.cli.app import COMMANDS, class_of, group_of
from pnpct.cli.parsing import options_of
from pnpct.cli.terminal import say, working


@dataclass(frozen=True)
class Completion:
    """Write a script with which a shell completes commands, options and their choices, and otherwise file names.

    Save it where the shell looks for it, again after each update of pnpct:

    pnpct completion bash > ~/.local/share/bash-completion/completions/pnpct

    pnpct completion fish > ~/.config/fish/completions/pnpct.fish

    pnpct completion zsh > ~/.pnpct.zsh, and in ~/.zshrc, after compinit: source ~/.pnpct.zsh

    Args:
        shell: The shell.
    """

    shell: Positional[Literal["bash", "zsh", "fish"]]

    def run(self, command: Sequence[str]) -> None:  # noqa: ARG002 - no file is written that would record it
        """Write the script to stdout."""
        with working("Reading the commands"):
            options = {name: {key: _choices(of) for key, of in options_of(class_of(name)).items()} for name in COMMANDS}
        firsts = [*dict.fromkeys(name.split()[0] for name in COMMANDS)]
        groups = {first: [name.split()[1] for name in group_of(first)] for first in firsts if first not in COMMANDS}
        groups = {"": firsts, **groups}
        if self.shell == "fish":
            say("\n".join(_fish(groups, options)))
            return
        begin = ["autoload -U +X bashcompinit && bashcompinit"] if self.shell == "zsh" else []
        say("\n".join([*begin, *_bash(groups, options)]))


Groups = dict[str, list[str]]
"""The words that may follow a group, or the program ("")."""

Options = dict[str, dict[str, list[str]]]
"""The options of each command, and the choices of each."""


def _choices(of: Any) -> list[str]:
    """The words that a type has, if it names them."""
    if get_origin(of) is Literal:
        return [str(word) for word in get_args(of)]
    return [word for part in get_args(of) for word in _choices(part)]


def _bash(groups: Groups, options: Options) -> Iterable[str]:
    yield "_pnpct() {"
    yield '  local current="${COMP_WORDS[COMP_CWORD]}" offered=""'
    yield '  local before="${COMP_WORDS[*]:1:$((COMP_CWORD - 1))}"'
    yield '  case "$before" in'
    for at, words in groups.items():
        yield f'    "{at}") offered="{" ".join(words)}" ;;'
    for command, named in options.items():
        for name, choices in named.items():
            if choices:
                yield f'    "{command} "*"{name}") offered="{" ".join(choices)}" ;;'
        yield f'    "{command}"|"{command} "*) [[ $current == -* ]] && offered="{" ".join([*named, "--help"])}" ;;'
    yield "  esac"
    yield '  COMPREPLY=($(compgen -W "$offered" -- "$current"))'
    yield "}"
    yield "complete -o default -F _pnpct pnpct"


def _fish(groups: Groups, options: Options) -> Iterable[str]:
    yield "function __pnpct_before; string match -qr -- \"^\\S+$argv\" (commandline -opc | string join ' '); end"
    for at, words in groups.items():
        yield f"complete -c pnpct -f -n '__pnpct_before \"{f' {at}' if at else ''}\\$\"' -a '{' '.join(words)}'"
    for command, named in options.items():
        for name, choices in named.items():
            value = f" -x -a '{' '.join(choices)}'" if choices else ""
            yield f"complete -c pnpct -n '__pnpct_before \" {command}( |\\$)\"' -l {name[2:]}{value}"
