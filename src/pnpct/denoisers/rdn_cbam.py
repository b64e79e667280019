"""The network of the paper: residual dense blocks with attention, which predict the noise of an image."""

from contextlib import nullcontext
from dataclasses import dataclass

import torch
from torch import nn
from torch.nn import functional
from typing_extensions import override

from pnpct.arrays import Image
from pnpct.denoisers.attention import Attention, ConvolutionalAttention, Features
from pnpct.denoisers.noise_level import NoiseLevel, check_noise_level

_WINDOW = 31  # pixels of the image


@dataclass(frozen=True)
class RDNSize:
    """How large a residual dense network is.

    Args:
        features: Channels between the blocks, at least 1.
        growth: Channels that each convolution of a block adds, at least 1.
        blocks: Residual dense blocks, at least 1.
        convolutions: Convolutions of 3 × 3 pixels in a block, at least 1.
        unshuffle: 1, or 2 to work on the four pixels of each 2 × 2 square as four channels: a quarter of the
            work and twice the reach.

    Raises:
        ValueError: If a number is out of range.
    """

    features: int
    growth: int
    blocks: int
    convolutions: int
    unshuffle: int = 1

    def __post_init__(self) -> None:
        if min(self.features, self.growth, self.blocks, self.convolutions) < 1:
            raise ValueError(f"A residual dense network needs at least one of everything, got {self}.")
        if self.unshuffle not in (1, 2):
            raise ValueError(f"Pixels are unshuffled by 1 (not at all) or 2, got {self.unshuffle}.")


SIZES: dict[str, RDNSize] = {
    "small": RDNSize(features=32, growth=16, blocks=4, convolutions=4, unshuffle=2),
    "medium": RDNSize(features=64, growth=32, blocks=8, convolutions=6),
    "original": RDNSize(features=64, growth=64, blocks=16, convolutions=8),
}
"""For two processor cores; for a graphics card; and as residual dense networks were published."""


class RDNCBAM(nn.Module):
    """A residual dense network with attention; a new one returns its input.

    It is given x = image − 1 (HU / 1000, water 0), not clipped, since clipped noise has a mean, and returns

        image − noise(x),   noise = C(f₀ + G[f₁ … f_D]),   f_d = f_{d−1} + attention(L[f_{d−1}, dense layers]),

    where [ ] are channels put together, L and G fuse them by 1 × 1 convolutions (G by a 3 × 3 one more), and
    f₀ are the shallow features. The paper says that its network "predicts noise" and that this is "added": here
    it is taken away. The last layer C starts at zero. Images of odd size continue as their mirror image while
    they are worked on. Away from the border the result depends on the surroundings of a pixel alone, and not on
    how much of the patient the image shows, unless the attention is "global".

    Args:
        size: One of `SIZES`, or another.
        noise_input: Whether it is noise-conditioned. If so it needs a noise level always, and else never.
        attention: "local", or "global" for the attention as it was published.

    References:
        Zhang et al., CVPR 2018 (residual dense networks); Woo et al., ECCV 2018 (attention); the paper,
        section 2.3.

    Example:
        >>> network = RDNCBAM(SIZES["small"])
        >>> network(torch.full((1, 16, 16), 1.25)).mean().item()
        1.25
    """

    def __init__(
        self, size: RDNSize = SIZES["small"], *, noise_input: bool = False, attention: Attention = "local"
    ) -> None:
        super().__init__()
        self.size, self.noise_input, self.attention = size, noise_input, attention
        pixels, features = size.unshuffle**2, size.features
        self.shallow = _convolution((1 + noise_input) * pixels, features)
        self.enter = _convolution(features, features)
        self.blocks = nn.ModuleList(_ResidualDenseBlock(size, attention) for _ in range(size.blocks))
        self.fuse = nn.Sequential(nn.Conv2d(size.blocks * features, features, 1), _convolution(features, features))
        self.noise = _convolution(features, pixels)
        for parameter in self.noise.parameters():
            nn.init.zeros_(parameter)

    @override
    def forward(self, image: Image, noise_level: NoiseLevel | None = None) -> Image:
        """Return the image without the noise found in it.

        Args:
            image: Attenuation relative to water, in the type and on the device of the network.
            noise_level: Standard deviation of the noise in units of the image, ≥ 0: a number, or an array
                that broadcasts to the image (a map, or one number per image of shape [batch, 1, 1]).

        Returns:
            An image of the same shape.

        Raises:
            ValueError: If a noise level is given to a network without that input, or is missing.
        """
        check_noise_level(self, noise_level)
        channels = [image - 1]
        if noise_level is not None:
            channels.append(torch.as_tensor(noise_level, dtype=image.dtype, device=image.device).expand_as(image))
        rows, cols = image.shape[-2:]
        inputs = torch.stack(channels, dim=-3).reshape(image.shape[:-2].numel(), len(channels), rows, cols)
        step = self.size.unshuffle
        # A mirror image at most one pixel wide is the border pixel again.
        inputs = functional.pad(inputs, (0, -cols % step, 0, -rows % step), mode="replicate")
        noise = functional.pixel_shuffle(self._predict(functional.pixel_unshuffle(inputs, step)), step)
        return image - noise[..., :rows, :cols].reshape(image.shape).to(image.dtype)

    def _predict(self, inputs: Features) -> Features:
        shallow = _unrounded(self.shallow, inputs)
        features = self.enter(shallow)
        of_blocks = []
        for block in self.blocks:
            features = block(features)
            of_blocks.append(features)
        return _unrounded(self.noise, shallow + self.fuse(torch.cat(of_blocks, dim=1)))


class _ResidualDenseBlock(nn.Module):
    """Convolutions that each see all before them, fused, weighed by attention and added to what came in."""

    def __init__(self, size: RDNSize, attention: Attention) -> None:
        super().__init__()
        before = range(size.features, size.features + size.convolutions * size.growth, size.growth)
        self.layers = nn.ModuleList(_convolution(channels, size.growth) for channels in before)
        self.fuse = nn.Conv2d(size.features + size.convolutions * size.growth, size.features, 1)
        self.attend = ConvolutionalAttention(size.features, window=_WINDOW // size.unshuffle, attention=attention)

    @override
    def forward(self, features: Features) -> Features:
        dense = features
        for layer in self.layers:
            dense = torch.cat([dense, torch.relu(layer(dense))], dim=1)
        attended: Features = self.attend(self.fuse(dense))
        return features + attended


def _unrounded(layer: nn.Module, features: Features) -> Features:
    # In mixed precision layers round what they read. At the ends that is the image itself and its noise, by 2 HU in
    # air, and these two layers are cheap.
    mixed = torch.amp.is_autocast_available(features.device.type)
    with torch.autocast(features.device.type, enabled=False) if mixed else nullcontext():
        result: Features = layer(features)
    return result


def _convolution(channels: int, filters: int) -> nn.Conv2d:
    return nn.Conv2d(channels, filters, 3, padding=1)
