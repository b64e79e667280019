"""What a denoiser depends on."""

from collections.abc import Callable
from dataclasses import asdict, is_dataclass
from typing import Any

from pnpct.arrays import Image


def denoiser_settings(denoise: Callable[[Image], Image]) -> dict[str, Any]:
    """Return what is known of a denoiser, as plain values: its `settings` if it has them, or its name and fields."""
    known: Any = denoise
    if isinstance(settings := getattr(known, "settings", None), dict):
        return settings
    fields = asdict(known) if is_dataclass(known) and not isinstance(known, type) else {}
    name = getattr(known, "__qualname__", type(known).__qualname__)
    return {"denoiser": name, **{f"denoiser_{field}": value for field, value in fields.items()}}
