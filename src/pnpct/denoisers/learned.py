"""From a trained network to a denoiser."""

import copy
import math
from dataclasses import dataclass, replace
from typing import Any

import torch
from torch import Tensor, nn

from pnpct.arrays import Image
from pnpct.denoisers.noise_level import NoiseLevel, NoiseOf, check_noise_level
from pnpct.geometry.short_repr import short_repr

DENSEST = 4.0
"""The largest value that a network is given, relative to water: 3000 HU, more than any bone.

What metal exceeds it by is passed on unchanged: in the ADMM loop networks made metal denser with each iteration.
"""


@dataclass(frozen=True, eq=False)
class LearnedDenoiser:
    """Denoise by a trained network: a callable from image to image, with any leading dimensions.

    It keeps a copy of the network: what happens to that later, in training or otherwise, does not change it. The
    copy is laid out with the channels last, which is faster on CPUs, and stays on the device of the network;
    images come from any device and go back to theirs, in their type. What exceeds `DENSEST` is added again afterwards.
    Not differentiable.

    Args:
        network: Takes images [batch, rows, cols] relative to water, and a noise level too if it has `noise_input`.
        noise_level: Standard deviation of the noise in units of the image, ≥ 0 (0.03 is 30 HU), or a map that
            broadcasts to the image, or a function that gives it of each image, such as `estimated_noise`; for networks
            conditioned on it, and only for these.
        passes: How often the network is applied, 1 to 4; 1.5 is the mean of once and twice. A second pass removes
            noise that the first has left, and some of the finest detail.
        bfloat16: Compute with 8 bits of precision instead of 24 inside the network, about twice as fast on hardware
            that supports it. The image itself is not rounded: behind the `n2n` that comes with the package the
            result changes by 0.1, 0.2 and 0.3 HU (root mean square) where the noise was 10, 50 and 200 HU.
        batch: Slices that are denoised together, at least 1. On a CPU one is fastest; more keep a GPU
            busy and need more memory.
        finest_pixel: Smallest pixels that the network has learnt from, mm; plug-and-play may divide larger ones.
        name: Its name for readers, such as "n2n".
        sha256: Of the file with the weights, in hexadecimal.

    Raises:
        ValueError: If the noise level is missing, not applicable, negative or not finite, or `passes` or `batch` is out
            of range.

    Example:
        >>> from pnpct.denoisers.rdn_cbam import RDNCBAM
        >>> LearnedDenoiser(RDNCBAM())(torch.ones(2, 3, 17, 16)).shape
        torch.Size([2, 3, 17, 16])
    """

    network: nn.Module
    noise_level: NoiseLevel | NoiseOf | None = None
    passes: float = 1.0
    bfloat16: bool = False
    batch: int = 1
    finest_pixel: float | None = None
    name: str = ""
    sha256: str = ""

    __repr__ = short_repr

    def __post_init__(self) -> None:
        check_noise_level(self.network, self.noise_level)
        if self.noise_level is not None and not callable(self.noise_level):
            _checked(self.noise_level)
        if self.batch < 1:
            raise ValueError(f"At least one slice is worked on at a time, got a batch of {self.batch}.")
        if not 1 <= self.passes <= 4:
            raise ValueError(f"A network is applied 1 to 4 times, got {self.passes:g} passes.")
        frozen = copy.deepcopy(self.network).eval().requires_grad_(False)
        frozen.to(memory_format=torch.channels_last)  # type: ignore[call-overload]  # its types do not know it
        object.__setattr__(self, "network", frozen)

    @property
    def settings(self) -> dict[str, Any]:
        """All that its images depend on, as plain values."""
        level_hu = {} if self.noise_level is None else {"noise_level_hu": _described(self.noise_level)}
        which = {"denoiser": self.name or type(self.network).__name__, "denoiser_sha256": self.sha256 or None}
        options = {"passes": self.passes, "bfloat16": self.bfloat16, "finest_pixel_mm": self.finest_pixel}
        return {**which, **level_hu, **options}

    def to(self, device: torch.device) -> "LearnedDenoiser":
        """Return the same denoiser with its network on another device."""
        return replace(self, network=copy.deepcopy(self.network).to(device))

    def __call__(self, image: Image) -> Image:
        """Return the denoised image."""
        result = self._once(image)
        for done in range(1, math.ceil(self.passes)):
            result = torch.lerp(result, self._once(result), min(self.passes - done, 1.0))
        return result

    def _once(self, image: Image) -> Image:
        image = image.detach()
        level = _checked(self.noise_level(image)) if callable(self.noise_level) else self.noise_level
        seen = image.clamp(max=DENSEST)
        slices = seen.reshape(seen.shape[:-2].numel(), *seen.shape[-2:])
        levels = None if level is None else torch.as_tensor(level).to(image).expand_as(image).reshape(slices.shape)
        place = next(self.network.parameters(), torch.empty(0))
        # Memory from outside inference mode: a caller may work on the result in place.
        result = torch.empty_like(slices)
        with torch.inference_mode(), torch.autocast(place.device.type, torch.bfloat16, enabled=self.bfloat16):
            for first in range(0, len(slices), self.batch):
                chosen = slice(first, first + self.batch)
                inputs = (slices,) if levels is None else (slices, levels)
                result[chosen] = self.network(*(array[chosen].to(place) for array in inputs)).to(image)
        return result.reshape(image.shape) + (image - seen)


def _checked(noise_level: NoiseLevel) -> Tensor:
    level = torch.as_tensor(noise_level)
    if not bool((torch.isfinite(level) & (level >= 0)).all()):
        low, high = level.min().item(), level.max().item()
        raise ValueError(f"A noise level is a standard deviation from 0 up, got {low:g} to {high:g}.")
    return level


def _described(noise_level: NoiseLevel | NoiseOf) -> float | str:
    """A noise level in HU, or what it is in a word."""
    if callable(noise_level):
        return str(getattr(noise_level, "__qualname__", type(noise_level).__qualname__))
    if isinstance(noise_level, Tensor):
        return 1000 * noise_level.item() if noise_level.numel() == 1 else "map"
    return 1000 * noise_level
