"""Worker processes for long work that falls into parts: of this machine, or of a Dask cluster."""

import multiprocessing
import os
import signal
import sys
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from itertools import islice
from multiprocessing.connection import wait
from typing import Any, TypeVar

import torch

from pnpct.operators.same_bytes import VALUE, VARIABLE

Result = TypeVar("Result")

AHEAD = 64
"""Most calls that `in_order` has under way, or done and not yet yielded."""


@contextmanager
def worker_processes(processes: int) -> Iterator[ProcessPoolExecutor]:
    """Yield processes that share the processor's cores, and end with the one that wants their work.

    They compute the same bytes wherever their arrays happen to lie in memory. Where the block is interrupted, they are
    terminated in the middle of what they are doing.

    Args:
        processes: How many, at least 1.
    """
    before = os.environ.get(VARIABLE)
    os.environ[VARIABLE] = VALUE
    threads = max(1, torch.get_num_threads() // processes)
    context = multiprocessing.get_context("spawn")
    others = multiprocessing.active_children()
    try:
        with ProcessPoolExecutor(processes, context, initializer=_begin_work, initargs=(threads,)) as pool:
            try:
                yield pool
            except (KeyboardInterrupt, GeneratorExit):
                for worker in multiprocessing.active_children():
                    if worker not in others:
                        worker.terminate()
                raise
    finally:
        if before is None:
            del os.environ[VARIABLE]
        else:
            os.environ[VARIABLE] = before


def side_by_side(
    function: Callable[..., Result], calls: Sequence[tuple[Any, ...]], *, processes: int, cluster: str | None = None
) -> Generator[Result, None, None]:
    """Yield what a function returns for each of several arguments, in the order in which they are done.

    Args:
        function: Of a module, since it is named to other processes.
        calls: Its arguments, one tuple for each call.
        processes: Calls at the same time, at least 1.
        cluster: Address of the scheduler of a Dask cluster, whose workers do the work in place of processes here.

    Raises:
        OSError: If a process dies, or the cluster cannot be reached.
        ModuleNotFoundError: If Dask is not installed.
    """
    with _workers(processes, cluster) as submit:
        with _held_back_signals():  # while the processes are started
            jobs = [submit(function, *call) for call in calls]
        for job in as_completed(jobs):
            yield job.result()


def in_order(
    function: Callable[..., Result], calls: Iterable[tuple[Any, ...]], *, processes: int, cluster: str | None = None
) -> Generator[Result, None, None]:
    """Yield what a function returns for each of several arguments, in their order; at most `AHEAD` wait to be yielded.

    Arguments and errors are those of `side_by_side`.
    """
    with _workers(processes, cluster) as submit:
        left = iter(calls)
        with _held_back_signals():
            jobs = deque(submit(function, *call) for call in islice(left, AHEAD))
        while jobs:
            yield jobs.popleft().result()
            jobs.extend(submit(function, *call) for call in islice(left, 1))


@contextmanager
def _workers(processes: int, cluster: str | None) -> Iterator[Callable[..., Future[Any]]]:
    """Give what submits a call to the processes or the cluster; calls that are left at the end are dropped."""
    if cluster is not None:
        from pnpct.operators.cluster import dask_workers

        with dask_workers(cluster) as submit:
            yield submit
        return
    with worker_processes(processes) as pool:
        try:
            yield pool.submit
        except BrokenProcessPool as error:
            raise OSError(
                "A process has died: for lack of memory, then start again with fewer processes; or because a script "
                'has no `if __name__ == "__main__":`.'
            ) from error
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


@contextmanager
def _held_back_signals() -> Iterator[None]:
    """Let signals wait until the block has ended; processes that are started in it go on without them."""
    if sys.platform == "win32":
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGHUP, signal.SIGTERM})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _begin_work(threads: int) -> None:
    """Prepare a worker, which ends when the process that wants its work is gone, however that has ended.

    Ctrl-C and the end of a terminal reach all processes; the one that wants the work answers for all.
    """
    torch.set_num_threads(threads)
    if sys.platform != "win32":
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})
    if parent := multiprocessing.parent_process():
        threading.Thread(target=lambda: (wait([parent.sentinel]), os._exit(1)), daemon=True).start()
