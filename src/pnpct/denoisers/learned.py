"""From a trained network to a denoiser."""

import copy
import math

import torch
from torch import nn

from pnpct.arrays import Image
from pnpct.denoisers.by_name import Denoise
from pnpct.denoisers.noise_level import NoiseLevel, check_noise_level

DENSEST = 4.0
"""What a network is shown at most, relative to water: 3000 HU, more than any bone.

What metal has beyond is handed on as it is: in the loop of ADMM networks made it denser with each iteration.
"""


def as_denoiser(
    network: nn.Module,
    *,
    noise_level: NoiseLevel | None = None,
    passes: float = 1.0,
    bfloat16: bool = False,
    batch: int = 1,
) -> Denoise:
    """Make a denoiser of a network.

    The denoiser keeps a copy: what happens to the network later, in training or otherwise, does not change it. The
    copy is laid out with the channels last, which is quicker on processors, and stays on the device of the network;
    images come from any device and go back to theirs, in their type. What exceeds `DENSEST` is added again afterwards.

    Args:
        network: Takes images [batch, rows, cols] relative to water, and a noise level too if it has `noise_input`.
        noise_level: Standard deviation of the noise in units of the image, ≥ 0 (0.03 is 30 HU), or a map that
            broadcasts to the image; for networks that are told it, and only for these.
        passes: How often the network is applied, 1 to 4; 1.5 is the mean of once and twice. A second pass takes away
            what the first has left, and some of the finest detail.
        bfloat16: Compute with 8 bits of precision instead of 24 inside the network, about twice as quick on hardware
            made for it. The image itself is not rounded: behind the `n2n` that comes with the package the
            result changes by 0.1, 0.2 and 0.3 HU (root mean square) where the noise was 10, 50 and 200 HU.
        batch: Slices that are worked on together, at least 1. On a processor one is quickest; more keep a graphics
            card busy and need more memory.

    Returns:
        A callable from image to image, with any leading dimensions. Not differentiable.

    Raises:
        ValueError: If the noise level is missing, not wanted, negative or not finite, or `passes` or `batch` is out of
            its range.

    Example:
        >>> from pnpct.denoisers.rdn_cbam import RDNCBAM
        >>> as_denoiser(RDNCBAM())(torch.ones(2, 3, 17, 16)).shape
        torch.Size([2, 3, 17, 16])
    """
    check_noise_level(network, noise_level)
    level = None if noise_level is None else torch.as_tensor(noise_level)
    if level is not None and not bool((torch.isfinite(level) & (level >= 0)).all()):
        low, high = level.min().item(), level.max().item()
        raise ValueError(f"A noise level is a standard deviation from 0 up, got {low:g} to {high:g}.")
    if batch < 1:
        raise ValueError(f"At least one slice is worked on at a time, got a batch of {batch}.")
    if not 1 <= passes <= 4:
        raise ValueError(f"The strength of a network is how often it is applied, 1 to 4 times, got {passes:g}.")
    frozen = copy.deepcopy(network).eval().requires_grad_(False)
    frozen.to(memory_format=torch.channels_last)  # type: ignore[call-overload]  # PyTorch knows it, its types do not
    place = next(frozen.parameters(), torch.empty(0))

    def once(image: Image) -> Image:
        image = image.detach()
        seen = image.clamp(max=DENSEST)
        slices = seen.reshape(seen.shape[:-2].numel(), *seen.shape[-2:])
        levels = None if level is None else level.to(image).expand_as(image).reshape(slices.shape)
        # Memory from outside inference mode: a caller may work on the result in place.
        result = torch.empty_like(slices)
        with torch.inference_mode(), torch.autocast(place.device.type, torch.bfloat16, enabled=bfloat16):
            for first in range(0, len(slices), batch):
                chosen = slice(first, first + batch)
                inputs = (slices,) if levels is None else (slices, levels)
                result[chosen] = frozen(*(array[chosen].to(place) for array in inputs)).to(image)
        return result.reshape(image.shape) + (image - seen)

    def denoise(image: Image) -> Image:
        result = once(image)
        for done in range(1, math.ceil(passes)):
            result = torch.lerp(result, once(result), min(passes - done, 1.0))
        return result

    return denoise
