"""Worker processes for long work that falls into parts."""

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing.connection import wait
from typing import Any, TypeVar

import torch

Result = TypeVar("Result")


@contextmanager
def worker_processes(processes: int) -> Iterator[ProcessPoolExecutor]:
    """Yield processes that share the processor's cores, and end with the one that wants their work.

    They compute the same bytes wherever their arrays happen to lie in memory. Where the block is interrupted, they are
    terminated in the middle of what they are doing.

    Args:
        processes: How many, at least 1.
    """
    before = os.environ.get("MKL_CBWR")
    os.environ["MKL_CBWR"] = "COMPATIBLE"
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
            del os.environ["MKL_CBWR"]
        else:
            os.environ["MKL_CBWR"] = before


def side_by_side(
    function: Callable[..., Result], calls: Sequence[tuple[Any, ...]], *, processes: int
) -> Generator[Result, None, None]:
    """Yield what a function returns for each of several arguments, in the order in which they are done.

    Args:
        function: Of a module, since it is named to other processes.
        calls: Its arguments, one tuple for each call.
        processes: Calls at the same time, at least 1.

    Raises:
        OSError: If a process dies.
    """
    with worker_processes(processes) as pool:
        with _held_back_signals():  # while the processes are started
            jobs = [pool.submit(function, *call) for call in calls]
        try:
            for job in as_completed(jobs):
                yield job.result()
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
