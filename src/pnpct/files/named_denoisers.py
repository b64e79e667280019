"""Denoisers by name: classical ones, the networks that come with the package, those in files, and your own."""

import math
from collections.abc import Mapping
from importlib.resources import files
from os import fspath
from pathlib import Path

import torch

from pnpct.denoisers import DENOISERS, Denoise, LearnedDenoiser, make_denoiser
from pnpct.denoisers.noise_level import is_noise_conditioned
from pnpct.files.checkpoint import SUFFIX, finest_pixel, load_network, weights_sha256
from pnpct.files.errors import PathLike
from pnpct.files.import_path import imported, imported_network, is_import_path
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
        name: A classical denoiser (`pnpct.denoisers.DENOISERS`), a network of `network_names`, a .safetensors file, or
            "my_package.module:name" for a network of your own or a function from image to image, or what makes one
            without arguments.
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
    if is_import_path(name):
        found = imported(fspath(name), kind="denoiser")
        if not isinstance(found, torch.nn.Module):
            given = {
                "strength": strength,
                "passes": passes,
                "noise_level_hu": noise_level_hu,
                "bfloat16": bfloat16 or None,
            }
            _check_unused(given, f"{fspath(name)}, which is no network")
            return _denoiser(found, fspath(name), torch.device(device))
    network, fingerprint = read_network(name)
    _check_unused({"strength": strength}, f"the network {Path(name).stem}, only on classical denoisers")
    if is_noise_conditioned(network) and noise_level_hu is None:
        raise ValueError(
            f"{Path(name).name} is noise-conditioned: give noise_level_hu, the standard deviation of the noise in HU."
        )
    if noise_level_hu is not None and not 0 <= noise_level_hu < math.inf:
        raise ValueError(f"noise_level_hu is a standard deviation in HU from 0 up, got {noise_level_hu:g}.")
    return LearnedDenoiser(
        network.to(device),
        noise_level=None if noise_level_hu is None else noise_level_hu / 1000,
        passes=1.0 if passes is None else passes,
        bfloat16=bfloat16,
        finest_pixel=None if is_import_path(name) else finest_pixel(network_file(name)),
        name=fspath(name),
        sha256=fingerprint,
    )


def read_network(name: PathLike) -> tuple[torch.nn.Module, str]:
    """Return a network by its name, and the SHA-256 of its weights' file.

    Args:
        name: A network of `network_names`, a .safetensors file, or "my_package.module:name" for one of your own.

    Raises:
        OSError: If it cannot be read.
        FileFormatError: As `load_network`.
        ValueError: If there is no such network.
    """
    if is_import_path(name):
        network = imported_network(fspath(name))
        return network, weights_sha256(network)
    path = network_file(name)
    return load_network(path), sha256_of(path)


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
        raise ValueError(
            f'There is no denoiser "{known}"; there are {there}, {SUFFIX} files of networks and my_package.module:name.'
        )
    return WEIGHTS / f"{known}{SUFFIX}"


def _denoiser(found: object, name: str, device: torch.device) -> Denoise:
    if not callable(found):
        raise ValueError(f"{name} must be a torch.nn.Module or a function from image to image, got {found!r}.")
    return found.to(device) if isinstance(found, LearnedDenoiser) else found


def _check_unused(options: Mapping[str, object], on: str) -> None:
    for option, value in options.items():
        if value is not None:
            raise ValueError(f"{option} has no effect on {on}; leave it out.")
