"""Pixels as text: what a page carries, and a browser unpacks without any library."""

import base64
import math
import zlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Pixels = NDArray[np.float64]

LARGEST = 32767

NOTHING = -LARGEST - 1
"""What stands in a map where nothing is known."""

MAP_SIDE = 256
"""So many rows and columns a map has at most; what it shows is coarser than pixels anyway."""


@dataclass(frozen=True)
class PackedPixels:
    """An image as text.

    Args:
        text: Base64 of what zlib has made of the planes of bytes.
        step: What one unit of the integers means, in the unit of the pixels.
        side: Rows and columns of the image for which each number stands.
        low: The least number that is known, 0 if none is.
        high: The largest, 0 if none is.
    """

    text: str
    step: float
    side: int = 1
    low: float = 0.0
    high: float = 0.0


def pack_hu(image_hu: Pixels) -> PackedPixels:
    """Pack HU, rounded to whole numbers; what 16 bits do not hold becomes the nearest that they do."""
    return PackedPixels(_packed(np.rint(image_hu).clip(-LARGEST - 1, LARGEST)), step=1.0)


def pack_map(values: Pixels) -> PackedPixels:
    """Pack other numbers in decimal steps, of which the largest number has a hundred to a thousand.

    Above `MAP_SIDE` rows or columns one number stands for a square of pixels: that which is farthest from 0, so that
    no finding is lost.

    Args:
        values: The numbers; infinite or NaN where nothing is known.
    """
    side = max(1, math.ceil(max(values.shape) / MAP_SIDE))
    coarse = _farthest_from_zero(np.where(np.isfinite(values), values, np.nan), side)
    known = coarse[~np.isnan(coarse)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 0.0)
    largest = max(-low, high)
    step = 10.0 ** (math.floor(math.log10(largest)) - 2) if largest > 0 else 1.0
    whole = np.where(np.isnan(coarse), NOTHING, np.rint(coarse / step))
    return PackedPixels(_packed(whole), step, side, low, high)


def _farthest_from_zero(values: Pixels, side: int) -> Pixels:
    """One number for each square; NaN where it has none."""
    rows, cols = (math.ceil(size / side) for size in values.shape)
    whole = np.full((rows * side, cols * side), np.nan)
    whole[: values.shape[0], : values.shape[1]] = values
    squares = whole.reshape(rows, side, cols, side).swapaxes(1, 2).reshape(rows, cols, side**2)
    chosen = np.where(np.isnan(squares), -1.0, np.abs(squares)).argmax(axis=2)
    return np.take_along_axis(squares, chosen[..., None], axis=2)[..., 0]


def _packed(whole: Pixels) -> str:
    """Whole numbers minus what their neighbours foretell, their low bytes before their high bytes, deflated.

    Neighbours are alike, so the differences are small. With the sign in the lowest bit their high bytes are
    nearly all 0; that makes noisy images a tenth smaller.
    """
    pixels = whole.astype(np.int16)
    differences = pixels - _foretold(pixels)  # wraps to 16 bits, and back when it is undone
    folded = ((differences << 1) ^ (differences >> 15)).astype("<i2")
    planes = folded.view(np.uint8).reshape(-1, 2).T.tobytes()
    return base64.b64encode(zlib.compress(planes, 9)).decode("ascii")


def _foretold(pixels: NDArray[np.int16]) -> NDArray[np.int16]:
    """What the pixels to the left, above and between them foretell, 0 beyond the border.

    It is the middle one of left, above, and left + above − between (the predictor of JPEG-LS): a smooth image takes a
    sixth less than by the left pixel alone, and noise no more.
    """
    padded = np.pad(pixels.astype(np.int32), ((1, 0), (1, 0)))
    left, above, between = padded[1:, :-1], padded[:-1, 1:], padded[:-1, :-1]
    low, high = np.minimum(left, above), np.maximum(left, above)
    foretold: NDArray[np.int16] = np.clip(left + above - between, low, high).astype(np.int16)
    return foretold
