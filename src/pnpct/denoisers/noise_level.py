"""How networks are told the noise level."""

from typing import TypeAlias

from jaxtyping import Float
from torch import Tensor, nn

NoiseLevel: TypeAlias = float | Float[Tensor, "..."]
"""Standard deviation of the noise in units of the image (0.03 is 30 HU): a number, or what broadcasts to the image."""


def is_told_noise_level(network: nn.Module) -> bool:
    """Say whether a network takes the noise level beside the image: it then has a true `noise_input`."""
    return bool(getattr(network, "noise_input", False))


def check_noise_level(network: nn.Module, noise_level: NoiseLevel | None) -> None:
    """Refuse a noise level that is missing or not wanted.

    Raises:
        ValueError: If a network that is told the noise level gets none, or one that is not gets one.
    """
    if is_told_noise_level(network) and noise_level is None:
        raise ValueError("This network is told the noise level: give noise_level, in units of the image.")
    if noise_level is not None and not is_told_noise_level(network):
        raise ValueError("This network has no input for a noise level; give none, or build it with noise_input=True.")
