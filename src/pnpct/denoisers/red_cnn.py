"""RED-CNN, the network that others are compared with."""

from itertools import pairwise

import torch
from torch import nn
from typing_extensions import override

from pnpct.arrays import Image
from pnpct.denoisers.attention import Features

_LAYERS = 5
_SIDE = 5
LEAST_SIDE = _LAYERS * (_SIDE - 1) + 1
"""Smallest number of rows and columns of an image: without padding, each convolution takes four away."""


class REDCNN(nn.Module):
    """The residual encoder-decoder of Chen et al.: five convolutions, five transposed ones, and three shortcuts.

    All have 5 × 5 pixels, no padding and a ReLU; the input, and the features after the second and the fourth
    convolution, are added on the way back, before the ReLU. Apart from the authors':

    - It is given image − 1 (HU / 1000, water 0) rather than HU from −1024 to 3072 mapped to 0 to 1, the same input
      as `RDNCBAM`.
    - The last ReLU is left out. It turns all noise below air into air, so that the noise that is left has a
      mean, and training on pairs of noisy images learns that mean. `network(image).clamp(min=0)` brings it back.
    - The last layer starts at zero, so that a new network returns its input.

    Args:
        filters: Filters of each layer but the last, at least 1.

    Raises:
        ValueError: If there are no filters.

    References:
        Chen et al., IEEE Trans. Med. Imaging 36 (2017) 2524.

    Example:
        >>> REDCNN(filters=4)(torch.ones(1, 32, 32)).shape
        torch.Size([1, 32, 32])
    """

    def __init__(self, filters: int = 96) -> None:
        super().__init__()
        if filters < 1:
            raise ValueError(f"A convolution needs at least one filter, got {filters}.")
        widths = [1] + [filters] * _LAYERS
        ways = list(pairwise(widths))
        self.filters = filters
        self.encoders = nn.ModuleList(nn.Conv2d(before, after, _SIDE) for before, after in ways)
        self.decoders = nn.ModuleList(nn.ConvTranspose2d(before, after, _SIDE) for after, before in reversed(ways))
        for parameter in self.decoders[-1].parameters():
            nn.init.zeros_(parameter)

    @override
    def forward(self, image: Image) -> Image:
        """Return the denoised image.

        Args:
            image: Attenuation relative to water, at least 21 × 21 pixels, in the type and on the device of the
                network.

        Returns:
            An image of the same shape.

        Raises:
            ValueError: If the image is too small.
        """
        rows, cols = image.shape[-2:]
        if min(rows, cols) < LEAST_SIDE:
            raise ValueError(f"RED-CNN needs images of at least {LEAST_SIDE} pixels a side, got {rows} x {cols}.")
        difference = self._predict((image - 1).reshape(image.shape[:-2].numel(), 1, rows, cols))
        return image + difference.reshape(image.shape).to(image.dtype)

    def _predict(self, image: Features) -> Features:
        one, two, three, four, five = self.encoders
        second = torch.relu(two(torch.relu(one(image))))
        fourth = torch.relu(four(torch.relu(three(second))))
        features = torch.relu(five(fourth))
        one, two, three, four, five = self.decoders
        features = torch.relu(one(features) + fourth)
        features = torch.relu(three(torch.relu(two(features))) + second)
        difference: Features = five(torch.relu(four(features)))
        return difference
