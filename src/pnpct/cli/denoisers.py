"""The denoisers of the commands: classical ones by name, networks by name or file, each with its strength."""

import math
from typing import Any

import torch

from pnpct.denoisers import DENOISERS, Denoise, as_denoiser, make_denoiser
from pnpct.denoisers.noise_level import is_told_noise_level
from pnpct.files import load_network, network_file, network_names, sha256_of
from pnpct.reconstruction.pnp_admm import BETA
from pnpct.reconstruction.tv_pwls import STRENGTH

TV_STRENGTH = 1000 * STRENGTH
"""λ of the method tv, HU × pixel."""

STRENGTHS = {"tv": TV_STRENGTH / BETA, "nonlocal-means": 70.0, "gaussian": 1.0}
"""Strength of each denoiser, in its unit, that suits a body at a low dose; with tv the image is that of the method."""

DEFAULT_STRENGTHS = ", ".join(f"{number:g} for {name}" for name, number in STRENGTHS.items())
"""What the help shows for a strength."""

CHOICES = "|".join([f"{{{','.join(DENOISERS)}}}", *network_names(), "FILE.safetensors"])
"""What the help shows for a denoiser."""


def choose_denoiser(
    name: str, strength: float | None, *, device: torch.device, bfloat16: bool = False
) -> tuple[Denoise, dict[str, Any]]:
    """Return a denoiser, and the settings that say which it is.

    Args:
        name: One of `DENOISERS`, a trained network that comes with the package, or a .safetensors file.
        strength: Its strength, that of `STRENGTHS` if None; HU of noise for networks that are told the noise level, and
            for the others how often they are applied, once if None.
        device: Where a network computes.
        bfloat16: Whether it computes with fewer digits; see `as_denoiser`.

    Raises:
        OSError: If a network cannot be read.
        ValueError: If there is no such denoiser, a classical one is asked to compute in bfloat16, the strength is out
            of its range, or a network that is told the noise level lacks one.
    """
    if name in DENOISERS:
        if bfloat16:
            raise ValueError(f"--bfloat16 has no effect on {name}, but on networks; leave it out.")
        strength = checked_strength(STRENGTHS[name] if strength is None else strength)
        return make_denoiser(name, strength), {"denoiser": name, "strength": strength}
    if not name.endswith(".safetensors") and name not in network_names():
        there = ", ".join([*DENOISERS, *network_names()])
        raise ValueError(f'There is no denoiser "{name}"; there are {there}, and .safetensors files of networks.')
    path = network_file(name)
    network = load_network(path).to(device)
    settings = {"denoiser": name, "denoiser_sha256": sha256_of(path), "bfloat16": bfloat16}
    if not is_told_noise_level(network):
        passes = 1.0 if strength is None else strength
        return as_denoiser(network, passes=passes, bfloat16=bfloat16), {**settings, "strength": passes}
    if strength is None:
        raise ValueError(f"{name} is told how noisy the image is: give --strength, in HU.")
    level = checked_strength(strength) / 1000
    return as_denoiser(network, noise_level=level, bfloat16=bfloat16), {**settings, "strength": strength}


def checked_strength(strength: float) -> float:
    """Return a strength.

    Raises:
        ValueError: If it is negative or not finite.
    """
    # Here, since the denoisers would say it in units of the image.
    if not 0 <= strength < math.inf:
        raise ValueError(f"The strength must be a number from 0 up, got {strength:g}.")
    return strength
