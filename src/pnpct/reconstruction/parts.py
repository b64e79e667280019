"""Parts of a volume, made in this process, in several, or by a cluster."""

import pickle
from collections.abc import Callable, Generator, Sequence
from functools import lru_cache
from typing import Any, TypeVar

from pnpct.arrays import Volume
from pnpct.operators.processes import in_order

Part = TypeVar("Part")


def made_in_order(
    make: Callable[[Part], Volume], parts: Sequence[Part], *, processes: int, cluster: str | None
) -> Generator[Volume, None, None]:
    """Yield what is made of each part, in their order.

    Args:
        make: What makes it; every process has its own.
        parts: The parts.
        processes: Processes that share them, at least 1.
        cluster: Address of the scheduler of a Dask cluster in place of these.

    Raises:
        OSError: If a process dies, or the cluster cannot be reached.
        ValueError: If the rays or the method cannot be given to other processes.
    """
    if processes < 1:
        raise ValueError(f"A volume needs at least one process, got {processes}.")
    if processes == 1 and cluster is None:
        yield from map(make, parts)
        return
    try:
        packed = pickle.dumps(make)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise ValueError(
            "The rays and the method cannot be given to other processes: define their classes and functions at the top "
            f"level of a module, or reconstruct in one process ({error})."
        ) from error
    yield from in_order(_made, [(packed, part) for part in parts], processes=processes, cluster=cluster)


def _made(packed: bytes, part: Any) -> Volume:
    return _unpacked(packed)(part)


@lru_cache(maxsize=1)
def _unpacked(packed: bytes) -> Callable[[Any], Volume]:
    """What a process makes all the parts of a volume with."""
    unpacked: Callable[[Any], Volume] = pickle.loads(packed)
    return unpacked
