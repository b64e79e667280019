"""Noise-conditioned networks: those that take the noise level beside the image."""

from typing import TypeAlias

from jaxtyping import Float
from torch import Tensor, nn

NoiseLevel: TypeAlias = float | Float[Tensor, "..."]
"""Standard deviation of the noise in units of the image (0.03 is 30 HU): a number, or what broadcasts to the image."""


def is_noise_conditioned(network: nn.Module) -> bool:
    """Return whether a network takes the noise level beside the image: it then has a true `noise_input`."""
    return bool(getattr(network, "noise_input", False))


def check_noise_level(network: nn.Module, noise_level: NoiseLevel | None) -> None:
    """Refuse a noise level that is missing or not applicable.

    Raises:
        ValueError: If a noise-conditioned network gets none, or another one gets one.
    """
    if is_noise_conditioned(network) and noise_level is None:
        raise ValueError("This network is noise-conditioned: give it the noise level, a standard deviation.")
    if noise_level is not None and not is_noise_conditioned(network):
        raise ValueError("This network is not noise-conditioned and takes no noise level; leave it out.")
