"""The options that choose a denoiser, for all commands that have one."""

from dataclasses import dataclass, fields
from typing import Annotated, Any

import torch

from pnpct.cli.parsing import given_options, option
from pnpct.denoisers import DENOISERS, Denoise
from pnpct.files import DEFAULT_DENOISER, load_denoiser, network_names

_NAMES = "|".join([f"{{{','.join([*network_names(), *DENOISERS])}}}", "FILE.safetensors", "MODULE:NAME"])
_STRENGTHS = ", ".join(f"{name}: {known.usual:g} {known.unit}" for name, known in DENOISERS.items())


@dataclass(frozen=True, kw_only=True)
class DenoiserOptions:
    """The denoiser and its options; None where not given, since an option that is given must have an effect.

    Args:
        denoiser: A network that comes with pnpct, the file of a trained network, a classical denoiser, or one of your
            own as module:name.
        strength: How strongly a classical denoiser smooths, each in its own unit.
        noise_level_hu: Standard deviation of the noise, HU, for networks that are noise-conditioned.
        passes: How many times a network is applied, 1 to 4; more passes remove more noise, and some fine detail.
        bfloat16: Let the network compute in bfloat16: about twice as fast on hardware that supports it.
    """

    denoiser: Annotated[str | None, option(default=DEFAULT_DENOISER, metavar=_NAMES)] = None
    strength: Annotated[float | None, option(default=_STRENGTHS)] = None
    noise_level_hu: Annotated[float | None, option(default="none")] = None
    passes: Annotated[float | None, option(default=1)] = None
    bfloat16: bool = False

    def chosen_denoiser(self, device: torch.device) -> Denoise:
        """Return the denoiser.

        Raises:
            OSError: If a network cannot be read.
            ValueError: If there is no such denoiser, or an option has no effect on it or is out of range.
        """
        return denoiser_with(given_options(self, DENOISER_OPTIONS), device)


DENOISER_OPTIONS = tuple(field.name for field in fields(DenoiserOptions))


def denoiser_with(options: dict[str, Any], device: torch.device) -> Denoise:
    """Return the denoiser of the options that were given."""
    name = options.pop("denoiser", DEFAULT_DENOISER)
    return load_denoiser(name, **options, device=device)
