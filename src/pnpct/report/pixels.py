"""Pixels as text: what a page carries, and a browser unpacks without any library."""

import base64
import math
import zlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Pixels = NDArray[np.float64]

LARGEST = 32767


@dataclass(frozen=True)
class PackedPixels:
    """An image as text.

    Args:
        text: Base64 of what zlib has made of the planes of bytes.
        step: What one unit of the integers means, in the unit of the pixels.
    """

    text: str
    step: float


def pack_hu(image_hu: Pixels) -> PackedPixels:
    """Pack HU, rounded to whole numbers; what 16 bits do not hold becomes the nearest that they do."""
    return PackedPixels(_packed(image_hu), step=1.0)


def pack_map(values: Pixels) -> PackedPixels:
    """Pack other numbers in decimal steps, of which the largest number has a hundred to a thousand."""
    largest = float(np.abs(values).max())
    step = 10.0 ** (math.floor(math.log10(largest)) - 2) if largest > 0 else 1.0
    return PackedPixels(_packed(values / step), step)


def _packed(values: Pixels) -> str:
    """Differences along each row, their low bytes before their high bytes, deflated.

    Neighbours are alike, so the differences are small. With the sign in the lowest bit their high bytes are
    nearly all 0; that makes noisy images a tenth smaller.
    """
    whole = np.rint(values).clip(-LARGEST - 1, LARGEST).astype(np.int16)
    differences = np.diff(whole, axis=1, prepend=np.int16(0))
    folded = ((differences << 1) ^ (differences >> 15)).astype("<i2")
    planes = folded.view(np.uint8).reshape(-1, 2).T.tobytes()
    return base64.b64encode(zlib.compress(planes, 9)).decode("ascii")
