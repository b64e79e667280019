"""The workers of a Dask cluster, on other machines or on this one, that share a folder with the one who asks.

A task whose worker dies is done by another one. `pip install 'pnpct[cluster]'` installs Dask.
"""

import os
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Future
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import Any

from pnpct.operators.same_bytes import compute_same_bytes

_PATIENCE = 10
"""Seconds in which a scheduler must answer."""


@contextmanager
def dask_workers(address: str) -> Iterator[Callable[..., Future[Any]]]:
    """Give what submits a call to a cluster; calls that are left at the end are dropped.

    Workers go to the folder that this process is in, so that relative paths name the same files.

    Args:
        address: Of the scheduler, such as "tcp://10.0.0.1:8786".

    Raises:
        ModuleNotFoundError: If Dask is not installed.
        OSError: If there is no scheduler or no worker, the connection is lost, or a task ends its worker again and
            again.
    """
    try:
        from distributed import Client, KilledWorker
        from distributed.comm.addressing import get_address_host_port
    except ModuleNotFoundError as missing:
        raise ModuleNotFoundError(
            "A cluster needs Dask, which is not installed; run: pip install 'pnpct[cluster]'."
        ) from missing
    try:
        get_address_host_port(address)  # or else a client would be half made, and try for long to undo it
        client = Client(address, timeout=_PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise OSError(
            f"There is no Dask scheduler at {address}; start one (dask scheduler), and give the address that it prints."
        ) from error
    with client:
        if not client.scheduler_info(n_workers=-1)["workers"]:
            raise OSError(f"The scheduler at {address} has no workers; start some: dask worker {address} --nthreads 1.")
        pool = client.get_executor(pure=False)
        try:
            yield lambda function, *call: pool.submit(_at, str(Path.cwd()), version("pnpct"), function, *call)
        except KilledWorker as error:
            raise OSError(
                "A task has ended several workers one after the other, for lack of memory: start workers with more."
            ) from error
        except CancelledError as error:
            raise OSError(f"The connection to {address} is lost; start again to go on.") from error
        finally:
            pool.shutdown(wait=False)


def _at(folder: str, pnpct: str, function: Callable[..., Any], *arguments: Any) -> Any:
    """Call a function on a worker, in a folder and with the bytes of a worker process."""
    if version("pnpct") != pnpct:
        raise ValueError(f"A worker has version {version('pnpct')} of pnpct, and {pnpct} is needed; install it there.")
    compute_same_bytes()
    try:
        os.chdir(folder)
    except OSError as error:
        raise OSError(
            f"A worker has no folder {folder}; a cluster needs a folder that all its machines have under one name."
        ) from error
    return function(*arguments)
