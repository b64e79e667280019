"""Threads for compiled kernels that release the interpreter lock.

numba's own parallel loops are not used: its default threading layer must not be entered by two Python threads
simultaneously, and its kernels take several times longer to compile and to load.
"""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache

import torch

_PIECES = 8
"""Pieces of work per thread: enough that a thread that was held up does not keep the others waiting."""


def at_once(work: Callable[..., object], count: int, *arguments: object, multiple: int = 1) -> None:
    """Call `work(*arguments, 0, count)` here: what takes less time than telling threads of it."""
    del multiple
    work(*arguments, 0, count)


def parallel(work: Callable[..., object], count: int, *arguments: object, multiple: int = 1) -> None:
    """Call `work(*arguments, first, last)` on pieces of range(count), on as many threads as PyTorch uses.

    Pieces begin at multiples of `multiple`. What a piece computes must not depend on the others; then the result does
    not depend on the number of threads.
    """
    threads = torch.get_num_threads()
    size = max(1, count // (threads * _PIECES * multiple)) * multiple
    pieces = [(first, min(first + size, count)) for first in range(0, count, size)]
    if threads == 1 or len(pieces) == 1:
        work(*arguments, 0, count)
        return
    for _ in _pool(os.getpid(), threads).map(lambda piece: work(*arguments, *piece), pieces):
        pass


@lru_cache(maxsize=4)
def _pool(_process: int, threads: int) -> ThreadPoolExecutor:
    """Return a pool of this process: threads do not survive a fork."""
    return ThreadPoolExecutor(threads, thread_name_prefix="pnpct")
