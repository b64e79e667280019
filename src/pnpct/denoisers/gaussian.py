"""A linear blur, the control that every other denoiser must beat."""

import math
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from pnpct.arrays import Image


@dataclass(frozen=True)
class Gaussian:
    """Blur with a Gaussian; borders reflect, so that the mean stays.

    The kernel is sampled at the pixels, cut at four standard deviations and normalised to sum 1, and the
    image continues as its mirror image beyond the edge of its outermost pixels (d c b a | a b c d | d c b a).

    Args:
        strength: Standard deviation in pixels, ≥ 0; 0 leaves the image as it is.

    Raises:
        ValueError: If `strength` is negative or not finite.

    Example:
        >>> Gaussian(strength=1.0)(torch.ones(2, 2)).shape
        torch.Size([2, 2])
    """

    strength: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.strength) and self.strength >= 0):
            raise ValueError(f"The blur needs a standard deviation in pixels from 0 up, got {self.strength}.")

    def __call__(self, image: Image) -> Image:
        """Return the blurred image."""
        radius = math.ceil(4 * self.strength)
        if radius == 0:
            return image.clone()
        offsets = torch.arange(-radius, radius + 1, dtype=image.dtype, device=image.device)
        kernel = torch.exp(-0.5 * (offsets / self.strength) ** 2)
        kernel /= kernel.sum()
        return _blur_columns(_blur_columns(image, kernel).mT, kernel).mT.contiguous()


def _blur_columns(image: Image, kernel: Float[Tensor, "taps"]) -> Image:
    cols, radius = image.shape[-1], len(kernel) // 2
    # Fold the positions into one period of the mirrored image: right for any radius, however small the image.
    position = torch.arange(-radius, cols + radius, device=image.device) % (2 * cols)
    mirrored = torch.minimum(position, 2 * cols - 1 - position)
    lines = image[..., mirrored].reshape(-1, 1, cols + 2 * radius)
    return torch.nn.functional.conv1d(lines, kernel[None, None]).reshape(image.shape)
