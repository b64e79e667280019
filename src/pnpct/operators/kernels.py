"""What projectors of every device do: the seam between the mathematics of rays and those who sum."""

from importlib.util import find_spec
from typing import Protocol, runtime_checkable

import torch
from torch import Tensor


@runtime_checkable
class Kernels(Protocol):
    """Forward and transpose of the same strips, for float32 tensors [slice][row][col] and [slice][ray].

    `CpuProjector`, `TorchProjector` and `TritonProjector` agree to rounding; each answers where it was asked.
    """

    def project(self, images: Tensor) -> Tensor:
        """Return the sums along all rays."""
        ...

    def back_project(self, rays: Tensor, *, squared: bool = False) -> Tensor:
        """Return the transpose of `project`, or of the same map with each weight squared."""
        ...


def triton_runs_on(device: torch.device) -> bool:
    """Return whether kernels of Triton run on the device; PyTorch for CUDA brings it on Linux."""
    return device.type == "cuda" and find_spec("triton") is not None
