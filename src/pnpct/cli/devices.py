"""The device to compute on."""

from dataclasses import replace
from typing import Literal

import torch

from pnpct.physics import Scan

DeviceName = Literal["auto", "cpu", "cuda"]


def choose_device(name: DeviceName) -> torch.device:
    """Return the device; "auto" is a CUDA device if there is one.

    Raises:
        ValueError: If a CUDA device is asked for and there is none.
    """
    if name == "cuda" and not torch.cuda.is_available():
        raise ValueError("--device cuda needs a CUDA device, but PyTorch finds none; use --device cpu.")
    return torch.device("cuda" if name != "cpu" and torch.cuda.is_available() else "cpu")


def on_device(scan: Scan, device: torch.device) -> Scan:
    """Return the scan with its arrays on a device."""
    return replace(scan, counts=scan.counts.to(device), incident=scan.incident.to(device))
