"""Output: results on stdout, errors and progress on stderr."""

import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import TypeVar

Item = TypeVar("Item")

_LONGEST = 1000
"""Letters of a line; the longest path that is usual has a few hundred."""


def say(text: str) -> None:
    """Write lines to stdout unbuffered: a log must have them even if the program is killed."""
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def complain(text: str) -> None:
    """Write one line to stderr, beginning with the program's name."""
    sys.stderr.write(f"pnpct: {shortened(' '.join(text.split()))}\n")
    sys.stderr.flush()


def shortened(text: str) -> str:
    """Return a text that a file may have made long, with its beginning and its end."""
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 200]} ... {text[-195:]}"


@contextmanager
def working(on: str) -> Iterator[None]:
    """Show on a terminal what is being done, until the block ends."""
    if not sys.stderr.isatty():
        yield
        return
    from rich.console import Console
    from rich.live import Live
    from rich.spinner import Spinner

    with Live(Spinner("dots", on), console=Console(stderr=True), transient=True, redirect_stdout=sys.stdout.isatty()):
        yield


def track(items: Iterable[Item], *, total: int, of: str) -> Iterator[Item]:
    """Yield the items with a bar on the terminal that disappears; it may end before the total."""
    if not sys.stderr.isatty():
        yield from items
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    console, together = Console(stderr=True), sys.stdout.isatty()
    with Progress(*columns, console=console, transient=True, redirect_stdout=together) as progress:
        task = progress.add_task(of, total=total)
        for item in items:
            progress.advance(task)
            yield item
