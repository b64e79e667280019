"""Worker processes for long work that falls into parts."""

import multiprocessing
import os
import threading
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing.connection import wait

import torch


@contextmanager
def worker_processes(processes: int) -> Iterator[ProcessPoolExecutor]:
    """Yield processes that share the processor's cores, and end with the one that wants their work.

    They compute the same bytes wherever their arrays happen to lie in memory.

    Args:
        processes: How many, at least 1.
    """
    before = os.environ.get("MKL_CBWR")
    os.environ["MKL_CBWR"] = "COMPATIBLE"
    threads = max(1, torch.get_num_threads() // processes)
    context = multiprocessing.get_context("spawn")
    try:
        with ProcessPoolExecutor(processes, context, initializer=_begin_work, initargs=(threads,)) as pool:
            yield pool
    finally:
        if before is None:
            del os.environ["MKL_CBWR"]
        else:
            os.environ["MKL_CBWR"] = before


def _begin_work(threads: int) -> None:
    """Prepare a worker, which ends when the process that wants its work is gone, however that has ended."""
    torch.set_num_threads(threads)
    if parent := multiprocessing.parent_process():
        threading.Thread(target=lambda: (wait([parent.sentinel]), os._exit(1)), daemon=True).start()
