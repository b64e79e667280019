"""Settings with which processes compute the same bytes, given the same number of threads."""

import os

VARIABLE, VALUE = "MKL_CBWR", "COMPATIBLE"
"""Of MKL, which else chooses its instructions by the processor, and by where arrays happen to lie in memory."""


def compute_same_bytes() -> None:
    """Have this process compute what other processes do that have called this; before anything is computed."""
    os.environ.setdefault(VARIABLE, VALUE)
