"""Several processes that train one network, as torchrun starts them."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar, cast

import torch
from torch import distributed

State = TypeVar("State")


@contextmanager
def joined_processes(device: torch.device) -> Iterator[int]:
    """Join the other processes that torchrun has started, if it has, and yield the rank of this one."""
    if "RANK" not in os.environ or int(os.environ.get("WORLD_SIZE", "1")) == 1:
        yield 0
        return
    if device.type == "cuda":
        torch.cuda.set_device(int(os.environ.get("LOCAL_RANK", "0")))
    distributed.init_process_group("nccl" if device.type == "cuda" else "gloo")
    try:
        yield distributed.get_rank()
    finally:
        distributed.destroy_process_group()


def from_first(read: Callable[[], State]) -> State:
    """Read something in the first process, and return it in all: the others may not see the file, or an older one."""
    if not distributed.is_initialized():
        return read()
    found = [read() if distributed.get_rank() == 0 else None]
    distributed.broadcast_object_list(found)
    return cast("State", found[0])
