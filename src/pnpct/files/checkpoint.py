"""Trained networks on disk: <name>.safetensors holds the weights, <name>.safetensors.json describes them.

Neither file holds code. The description of one of pnpct's networks says all of it: whatever is in the files, reading
them runs nothing. That of a network of your own names where Python can import it from: reading it imports that module,
which must be installed.
"""

import hashlib
import json
import os
import re
from collections.abc import Mapping
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any, get_args

import torch
from safetensors import SafetensorError
from safetensors.torch import load, save
from torch import Tensor, nn

from pnpct.denoisers import RDNCBAM, REDCNN, RDNSize
from pnpct.denoisers.attention import Attention
from pnpct.denoisers.noise_level import is_noise_conditioned
from pnpct.files.atomic import atomic_path
from pnpct.files.errors import FileFormatError, PathLike, existing_file
from pnpct.files.import_path import described_network, is_import_path, where_imported
from pnpct.files.json_file import load_json

FORMAT = "pnpct-network"
FORMAT_VERSION = 1
SUFFIX = ".safetensors"
ARCHITECTURES = ("rdn-cbam", "red-cnn")
NORMALISATION = "HU/1000"
"""What pnpct's networks are given: HU / 1000, computed inside them from the image relative to water."""
UNITS = "attenuation relative to water (air 0, water 1; HU = 1000 (image - 1))"
ABOUT = ("command", "licence", "manifest_sha256", "metrics", "seed")
"""What must be recorded about a network: the command line, the licence, the SHA-256 of the manifest of the training
data, figures of merit and the seed; each may be None where there is none."""


def save_network(
    path: PathLike, network: nn.Module, *, about: Mapping[str, Any], architecture: str | None = None
) -> None:
    """Write a network, and its description beside it.

    The same network and description give the same bytes. If the machine stops between the renaming of the two
    files, their fingerprints do not match and `load_network` refuses them.

    Args:
        path: File for the weights, .safetensors; existing files are replaced.
        network: An `RDNCBAM`, a `REDCNN`, or a network of your own that takes images [batch, rows, cols] relative to
            water (`AdaptedNetwork` makes others do so); its parameters are stored as float32.
        architecture: Where a network of your own can be imported from, "my_package.module:name": such a network, its
            class, or a function `() -> nn.Module`. One that was imported by `imported_network` knows it.
        about: Plain values by name, those of `ABOUT` among them, and perhaps `finest_pixel_mm`, the smallest pixels of
            the training images: plug-and-play may divide larger ones (`LearnedDenoiser`).

    Raises:
        OSError: If a file cannot be written.
        ValueError: If the suffix is wrong, nothing says where a network of your own comes from or it would not take the
            weights, parameters are not finite, or `about` lacks something or cannot be written as JSON.

    Example:
        >>> import tempfile
        >>> path = Path(tempfile.mkdtemp()) / "tiny.safetensors"
        >>> save_network(path, REDCNN(filters=2), about=dict.fromkeys(ABOUT))
        >>> load_network(path).filters
        2
    """
    path = Path(path)
    if path.suffix != SUFFIX:
        raise ValueError(f"The file of a network must end in {SUFFIX}, got {path.name}.")
    tensors = {name: _stored(tensor) for name, tensor in network.state_dict().items()}
    description = _describe(network, architecture or where_imported(network), tensors)
    about = _plain(about)
    if broken := [name for name, tensor in tensors.items() if not tensor.isfinite().all()]:
        raise ValueError(f"{path} was not written: the parameters {_first_of(broken)} are not finite.")
    numbers = save(tensors)
    content = {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "pnpct": version("pnpct"),
        "normalisation": NORMALISATION,
        **description,
        "units": UNITS,
        "sha256": hashlib.sha256(numbers).hexdigest(),
        "about": about,
    }
    with atomic_path(_sidecar(path)) as temporary_sidecar, atomic_path(path) as temporary:
        # On the disk before the first renaming, so that a full disk spares both older files.
        with temporary_sidecar.open("w", encoding="utf-8") as file:
            file.write(json.dumps(content, indent=1, ensure_ascii=False) + "\n")
            file.flush()
            os.fsync(file.fileno())
        temporary.write_bytes(numbers)


def load_network(path: PathLike) -> nn.Module:
    """Read what `save_network` wrote.

    Args:
        path: The .safetensors file.

    Returns:
        The network, on the CPU, in training mode.

    Raises:
        OSError: If there is no such file or it cannot be read.
        FileFormatError: If its description is missing, or does not match the weights or this version of pnpct.
    """
    path = existing_file(path)
    sidecar = _sidecar(path)
    if not sidecar.is_file():
        raise FileFormatError(f"{path} comes without {sidecar.name}, which describes the network; copy both files.")
    content = _read_sidecar(sidecar)
    network = _build(sidecar, content)
    numbers = path.read_bytes()
    if hashlib.sha256(numbers).hexdigest() != content.get("sha256"):
        raise FileFormatError(f"{path} is not the file that {sidecar.name} describes (SHA-256); copy both again.")
    try:
        tensors = {name: tensor.clone() for name, tensor in load(numbers).items()}
    except (SafetensorError, KeyError, ValueError) as error:
        raise FileFormatError(f"{path} is not a complete {SUFFIX} file; copy it again.") from error
    _check_tensors(path, tensors, network.state_dict())
    network.load_state_dict(tensors, assign=True)
    return network


def finest_pixel(path: PathLike) -> float | None:
    """Return the smallest pixels that a network has learnt from, mm, or None if its description does not say so.

    Args:
        path: The .safetensors file; `about` of `save_network` may name "finest_pixel_mm".
    """
    about = _read_sidecar(_sidecar(existing_file(path))).get("about")
    size = about.get("finest_pixel_mm") if isinstance(about, dict) else None
    return float(size) if isinstance(size, int | float) and size > 0 else None


def _sidecar(path: Path) -> Path:
    return path.with_name(path.name + ".json")


def weights_sha256(network: nn.Module) -> str:
    """Return the SHA-256 of the weights, in hexadecimal, as `save_network` would store them."""
    return hashlib.sha256(save({name: _stored(one) for name, one in network.state_dict().items()})).hexdigest()


def _stored(tensor: Tensor) -> Tensor:
    """A tensor of its own, in float32 if it has fractions."""
    own = tensor.detach().cpu().clone(memory_format=torch.contiguous_format)
    return own.float() if own.is_floating_point() else own


def _describe(network: nn.Module, path: str | None, tensors: Mapping[str, Tensor]) -> dict[str, Any]:
    # A subclass may compute something else with the same weights.
    if type(network) is RDNCBAM:
        described: dict[str, Any] = {"noise_input": network.noise_input, "attention": network.attention}
        return {"architecture": "rdn-cbam", "size": asdict(network.size), **described}
    if type(network) is REDCNN:
        return {
            "architecture": "red-cnn",
            "size": {"filters": network.filters},
            "noise_input": False,
            "attention": None,
        }
    if path is None:
        raise ValueError(
            f"Only an RDNCBAM or a REDCNN describes itself; say by architecture where {type(network).__name__} can be "
            "imported from."
        )
    if not is_import_path(path):
        raise ValueError(f'architecture is like "my_package.module:name", got "{path}".')
    _check_tensors(Path(path), tensors, described_network(path).state_dict())
    noise_input = is_noise_conditioned(network)
    return {"architecture": path, "size": {}, "noise_input": noise_input, "attention": None, "normalisation": "its own"}


def _plain(about: Mapping[str, Any]) -> dict[str, Any]:
    if missing := [name for name in ABOUT if name not in about]:
        raise ValueError(f"The description of a network must name {', '.join(ABOUT)}; {_first_of(missing)} is missing.")
    digest = about["manifest_sha256"]
    if digest is not None and not (isinstance(digest, str) and re.fullmatch(r"[0-9a-f]{64}", digest)):
        raise ValueError(f"manifest_sha256 must be a SHA-256 in hexadecimal or None, got {digest!r}.")
    try:
        plain: dict[str, Any] = json.loads(json.dumps(dict(about), sort_keys=True, allow_nan=False))
    except (TypeError, ValueError) as error:
        raise ValueError(f"The description of a network must be plain, finite values: {error}.") from error
    return plain


def _read_sidecar(sidecar: Path) -> dict[str, Any]:
    content = load_json(sidecar)
    if content.get("format") != FORMAT:
        raise FileFormatError(f"{sidecar} does not describe a network of pnpct.")
    number = content.get("format_version")
    if not isinstance(number, int) or number > FORMAT_VERSION:
        raise FileFormatError(
            f"{sidecar} has the format version {number}, but {FORMAT_VERSION} is known; update pnpct."
        )
    known_networks = (("normalisation", NORMALISATION), ("units", UNITS))
    for key, known in known_networks[is_import_path(str(content.get("architecture"))) :]:
        if content.get(key) != known:
            raise FileFormatError(f'{sidecar} has the {key} "{content.get(key)}", but "{known}" is needed.')
    return content


def _build(sidecar: Path, content: Mapping[str, Any]) -> nn.Module:
    """A network without weights, which takes neither memory nor random numbers."""
    architecture, size = content.get("architecture"), content.get("size")
    if isinstance(architecture, str) and is_import_path(architecture):
        return described_network(architecture)
    if architecture not in ARCHITECTURES:
        known = " and ".join(ARCHITECTURES)
        raise FileFormatError(f'{sidecar} names the architecture "{architecture}"; {known} are known.')
    try:
        if not isinstance(size, dict) or not all(type(number) is int for number in size.values()):
            raise ValueError(f"its size is {size}")
        with torch.device("meta"):
            if architecture == "red-cnn":
                return REDCNN(**size)
            noise_input, attention = content["noise_input"], content["attention"]
            if not isinstance(noise_input, bool) or attention not in get_args(Attention):
                raise ValueError(f"noise_input is {noise_input} and attention {attention}")
            return RDNCBAM(RDNSize(**size), noise_input=noise_input, attention=attention)
    except (KeyError, RuntimeError, TypeError, ValueError) as error:
        reason = " ".join(str(error).split()).rstrip(".")
        raise FileFormatError(f"{sidecar} does not describe a complete {architecture} network: {reason}.") from error


def _check_tensors(path: Path, found: Mapping[str, Tensor], needed: Mapping[str, Tensor]) -> None:
    other = [
        name
        for name in sorted(found.keys() & needed.keys())
        if (found[name].shape, found[name].dtype) != (needed[name].shape, needed[name].dtype)
    ]
    if missing := sorted(needed.keys() - found.keys()):
        raise FileFormatError(f"{path} lacks {_first_of(missing)} of the network that is described beside it.")
    if extra := sorted(found.keys() - needed.keys()):
        raise FileFormatError(f"{path} holds {_first_of(extra)}, which the network described beside it has not.")
    if other:
        came, need = (f"{list(tensors[other[0]].shape)} {tensors[other[0]].dtype}" for tensors in (found, needed))
        raise FileFormatError(f"{path}: {_first_of(other)} must be {need} for the network described, got {came}.")


def _first_of(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{names[0]} and {len(names) - 1} more"
