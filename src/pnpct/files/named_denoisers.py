"""Denoisers by name: classical ones, the networks that come with the package, and networks in files."""

import math
from collections.abc import Mapping
from importlib.resources import files
from os import fspath
from pathlib import Path

import torch

from pnpct.denoisers import DENOISERS, Denoise, LearnedDenoiser, make_denoiser
from pnpct.denoisers.noise_level import is_noise_conditioned
from pnpct.files.checkpoint import SUFFIX, load_network
from pnpct.files.errors import PathLike
from pnpct.files.provenance import sha256_of

DEFAULT_DENOISER = "n2n"
"""The network that was trained in two stages."""

WEIGHTS = Path(str(files("pnpct.denoisers"))) / "weights"
"""Folder of the networks that come with the package."""


def load_denoiser(
    name: PathLike = DEFAULT_DENOISER,
    *,
    strength: float | None = None,
    noise_level_hu: float | None = None,
    passes: float | None = None,
    bfloat16: bool = False,
    device: torch.device | str = "cpu",
) -> Denoise:
    """Return a denoiser by its name.

    Args:
        name: A classical denoiser (`pnpct.denoisers.DENOISERS`), a network of `network_names`, or a .safetensors file.
        strength: How much a classical denoiser smooths, in its own unit; its usual strength if None.
        noise_level_hu: Standard deviation of the noise, HU, for noise-conditioned networks, and only for these.
        passes: How often a network is applied, 1 to 4; once if None.
        bfloat16: Let a network compute in bfloat16; see `LearnedDenoiser`.
        device: Where a network computes.

    Raises:
        OSError: If a network cannot be read.
        FileFormatError: As `load_network`.
        ValueError: If there is no such denoiser, an option has no effect on it or is out of range, or a
            noise-conditioned network lacks the noise level.
    """
    if name in DENOISERS:
        given = {"passes": passes, "noise_level_hu": noise_level_hu, "bfloat16": bfloat16 or None}
        _check_unused(given, f"{name}, only on networks")
        return make_denoiser(str(name), strength)
    path = network_file(name)
    _check_unused({"strength": strength}, f"the network {path.stem}, only on classical denoisers")
    network = load_network(path).to(device)
    if is_noise_conditioned(network) and noise_level_hu is None:
        raise ValueError(
            f"{path.name} is noise-conditioned: give noise_level_hu, the standard deviation of the noise in HU."
        )
    if noise_level_hu is not None and not 0 <= noise_level_hu < math.inf:
        raise ValueError(f"noise_level_hu is a standard deviation in HU from 0 up, got {noise_level_hu:g}.")
    return LearnedDenoiser(
        network,
        noise_level=None if noise_level_hu is None else noise_level_hu / 1000,
        passes=1.0 if passes is None else passes,
        bfloat16=bfloat16,
        name=fspath(name),
        sha256=sha256_of(path),
    )


def network_names() -> tuple[str, ...]:
    """Return the names of the trained networks that come with the package."""
    return tuple(sorted(path.stem for path in WEIGHTS.glob(f"*{SUFFIX}")))


def network_file(name: PathLike) -> Path:
    """Return the .safetensors file of a network.

    Args:
        name: Such a file, or one of `network_names`.

    Raises:
        ValueError: If no network has this name.
    """
    if Path(name).suffix == SUFFIX:
        return Path(name)
    if (known := fspath(name)) not in network_names():
        there = ", ".join([*DENOISERS, *network_names()])
        raise ValueError(f'There is no denoiser "{known}"; there are {there}, and {SUFFIX} files of networks.')
    return WEIGHTS / f"{known}{SUFFIX}"


def _check_unused(options: Mapping[str, object], on: str) -> None:
    for option, value in options.items():
        if value is not None:
            raise ValueError(f"{option} has no effect on {on}; leave it out.")
