"""Denoisers as a user may have them in a module of her own."""

import torch
from torch import nn

from pnpct.denoisers import AdaptedNetwork, Gaussian, TotalVariation


class Smoother(nn.Module):
    """Of pnpct's own shape, with a number that is no weight and buffers of two types."""

    def __init__(self) -> None:
        super().__init__()
        self.layers = nn.Sequential(nn.Conv2d(1, 2, 3, padding=1), nn.BatchNorm2d(2), nn.Conv2d(2, 1, 1))

    def forward(self, image: torch.Tensor) -> torch.Tensor:
        return image - 0.1 * self.layers(image[:, None] - 1)[:, 0]


class Shrinker(nn.Module):
    """Like the denoisers of deepinv: (images [batch, 1, rows, cols], sigma)."""

    def __init__(self) -> None:
        super().__init__()
        self.scale = nn.Parameter(torch.ones(1))

    def forward(self, x: torch.Tensor, sigma: torch.Tensor) -> torch.Tensor:
        return x - self.scale * sigma.reshape(-1, 1, 1, 1)


def make() -> AdaptedNetwork:
    return AdaptedNetwork(nn.Conv2d(1, 1, 3, padding=1), range_hu=(-1024, 3071))


def make_untold():
    raise AssertionError("a function that a file names is called only if it says that it returns a network")


ADAPTED = AdaptedNetwork(Shrinker(), range_hu=(-1000, 1000), sigma="image")
BLUR = Gaussian(0.5)
NUMBER = 3
__all__ = ["ADAPTED", "BLUR", "NUMBER", "Shrinker", "Smoother", "TotalVariation", "make", "make_untold"]
