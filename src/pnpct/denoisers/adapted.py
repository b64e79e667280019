"""Networks of your own, in the terms of pnpct's."""

import math
from collections.abc import Callable
from typing import Literal, TypeAlias, get_args

from jaxtyping import Float
from torch import Tensor, nn
from typing_extensions import override

from pnpct.arrays import Image

SigmaInput: TypeAlias = Literal["none", "image", "pixel"]
"""Whether a network takes the noise level: not at all, as a number for each image, or as a map."""


class AdaptedNetwork(nn.Module):
    """A network, or any function of tensors, that `LearnedDenoiser` and training can use like one of pnpct's.

    Those are given images [batch, rows, cols] relative to water, and perhaps the noise level of each pixel. This one
    turns the images into what the network expects and its output back; both are differentiable. With v the HU of a
    pixel, the network is given (v − low) / (high − low).

    Args:
        network: From images to denoised images, or from images and noise level. `deepinv`'s denoisers take both, as
            numbers for each image.
        range_hu: The HU that the network knows as 0 and 1: (0, 1) for HU, (-1000, 0) for attenuation relative to water,
            (-1024, 3071) for 12 bits normalised to 0 to 1. Nothing is clipped, since clipped noise has a mean.
        sigma: How the network takes the noise level, as its second argument, a standard deviation in units of its
            input: "none", "image" for numbers [batch], "pixel" for maps of the shape of the images.
        channel: Whether its images are [batch, 1, rows, cols], as usual, or [batch, rows, cols].

    Raises:
        ValueError: If the range is empty or not finite, or `sigma` is unknown.

    Example:
        >>> import torch
        >>> from pnpct.denoisers import LearnedDenoiser
        >>> blur = AdaptedNetwork(nn.AvgPool2d(3, stride=1, padding=1), range_hu=(-1024, 3071))
        >>> LearnedDenoiser(blur)(torch.ones(2, 16, 16)).shape
        torch.Size([2, 16, 16])
    """

    def __init__(
        self,
        network: Callable[..., Tensor],
        *,
        range_hu: tuple[float, float] = (-1000.0, 0.0),
        sigma: SigmaInput = "none",
        channel: bool = True,
    ) -> None:
        super().__init__()
        low, high = range_hu
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise ValueError(f"range_hu is the HU of 0 and of 1, the first below the second, got {range_hu}.")
        if sigma not in get_args(SigmaInput):
            raise ValueError(f'sigma is one of {", ".join(get_args(SigmaInput))}, got "{sigma}".')
        self.network, self.range_hu, self.sigma, self.channel = network, (low, high), sigma, channel

    @property
    def noise_input(self) -> bool:
        """Whether it takes the noise level beside the image."""
        return self.sigma != "none"

    @override
    def forward(
        self, image: Float[Tensor, "batch rows cols"], noise_level: Float[Tensor, "batch rows cols"] | None = None
    ) -> Image:
        """Return the denoised images.

        Args:
            image: Attenuation relative to water.
            noise_level: Standard deviation of the noise of each pixel, relative to water, where the network takes it;
                of a network that takes a number for each image the mean counts.

        Raises:
            ValueError: If the network returns another shape.
        """
        low, high = (hu / 1000 + 1 for hu in self.range_hu)
        inputs = [self._shaped((image - low) / (high - low))]
        if noise_level is not None:
            level = noise_level / (high - low)
            inputs.append(level.mean((-2, -1)) if self.sigma == "image" else self._shaped(level))
        output = self.network(*inputs)
        if output.shape != inputs[0].shape:
            raise ValueError(
                f"A denoiser returns images of the shape that it is given, {tuple(inputs[0].shape)}, and this one "
                f"returned {tuple(output.shape)}."
            )
        return output.reshape(image.shape) * (high - low) + low

    def _shaped(self, images: Tensor) -> Tensor:
        return images.unsqueeze(1) if self.channel else images
