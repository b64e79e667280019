"""The command line: one file per command, each of which parses, calls and writes."""

from pnpct.cli.app import main

__all__ = ["main"]
