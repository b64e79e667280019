"""What a method returns."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pnpct.arrays import Image
from pnpct.geometry.short_repr import short_repr


@dataclass(frozen=True, eq=False)
class Reconstruction:
    """An image, and how it was made.

    Args:
        image: The image, relative to water.
        settings: All that it depends on besides the data, as plain values.
        iterations: How many iterations were done; 0 where there are none.
        stopped_by: What ended them: the name of a rule, or "iterations"; empty where there are none.
        notes: What readers of the image should know, in sentences.
    """

    image: Image
    settings: Mapping[str, Any]
    iterations: int = 0
    stopped_by: str = ""
    notes: tuple[str, ...] = ()

    __repr__ = short_repr
