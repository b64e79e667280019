"""Methods as users write them."""

from dataclasses import dataclass

import torch

from pnpct.reconstruction import PlugAndPlay


@dataclass(frozen=True)
class Smoothed:
    """A denoiser of one's own."""

    pixels: float

    def __call__(self, image: torch.Tensor) -> torch.Tensor:
        return image - image.mean() / self.pixels


ONE = PlugAndPlay(Smoothed(2.0), iterations=2)
SEVERAL = {"first": ONE, "second": PlugAndPlay(Smoothed(3.0))}
NUMBER = 3


def make_one() -> PlugAndPlay:
    return ONE


def make_several() -> dict[str, PlugAndPlay]:
    return SEVERAL


def plain(sinogram, A) -> torch.Tensor:
    """No value, but it can be called."""
    return A.T(sinogram.line_integrals) / 1000


def broken() -> PlugAndPlay:
    raise RuntimeError("out of order")
