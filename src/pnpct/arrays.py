"""Names of arrays: the last dimensions have a meaning, the leading ones are a batch (there may be none).

A batch holds noise realisations, or objects that have nothing to do with each other. Neighbouring slices and detector
rows belong together and are an axis of their own.
"""

from typing import TypeAlias

from jaxtyping import Bool, Float
from torch import Tensor

Image: TypeAlias = Float[Tensor, "*batch rows cols"]
"""Attenuation relative to water: air 0, water 1."""

Volume: TypeAlias = Float[Tensor, "*batch slices rows cols"]
"""The same for neighbouring slices, from the feet to the head."""

Rays: TypeAlias = Float[Tensor, "*batch views bins"]
"""One number per ray of a fan beam: counts, line integrals or weights."""

ConeRays: TypeAlias = Float[Tensor, "*batch views detector_rows bins"]
"""One number per ray of a cone beam, the lowest row first."""

Support: TypeAlias = Bool[Tensor, "rows cols"]
"""The pixels of an image, or of each slice, that may be other than air."""
