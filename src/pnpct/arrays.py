"""Names of arrays: the last two dimensions have a meaning, the leading ones are a batch (there may be none)."""

from typing import TypeAlias

from jaxtyping import Float
from torch import Tensor

Image: TypeAlias = Float[Tensor, "*batch rows cols"]
"""Attenuation relative to water: air 0, water 1."""

Rays: TypeAlias = Float[Tensor, "*batch views bins"]
"""One number per ray: counts, line integrals or weights."""
