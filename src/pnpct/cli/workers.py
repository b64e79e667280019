"""Who does work that falls into parts: processes of this machine, or a cluster."""

from typing import Annotated, Any, TypeAlias

from pnpct.cli.parsing import option

Cluster: TypeAlias = Annotated[str | None, option(metavar="ADDRESS", default="none")]
"""Address of the scheduler of a Dask cluster."""


def chosen_workers(processes: int | None, cluster: str | None, *, usual: int) -> dict[str, Any]:
    """Return the options `processes` and `cluster` of the functions that share work.

    Args:
        processes: How many, or None where that is not given.
        cluster: Address of a scheduler, or None.
        usual: Processes where none are given.

    Raises:
        ValueError: If both are given.
    """
    if cluster is None:
        return {"processes": usual if processes is None else processes}
    if processes is not None:
        raise ValueError("--processes are those of this machine, and --cluster has its own workers; leave out one.")
    return {"cluster": cluster}
