"""The pixels that count: those of an object, and some air around it.

What an image has elsewhere no ray meets. It is a mask of an image, and in a volume of every slice.
"""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from pnpct.arrays import Image, Support, Volume
from pnpct.operators.ray_lines import RayLines

Reach: TypeAlias = NDArray[np.float32]
"""Rows, or blocks of them, by two: the first column and that after the last."""


def check_support(support: Support | None, shape: tuple[int, ...]) -> None:
    """Check that a support has the pixels of an image, or of the slices of a volume.

    Raises:
        ValueError: If it has another shape.
    """
    if support is not None and tuple(support.shape) != shape[-2:]:
        raise ValueError(f"The support has {tuple(support.shape)} pixels, the image {shape[-2:]}.")


def supported(image: Image | Volume, support: Support | None) -> Image | Volume:
    """Return an image with 0 outside its support; None are all pixels."""
    return image if support is None else image.where(support.to(image.device), 0)


def part_supported(support: Support | None) -> float:
    """Return how many of the pixels have support, over all of them."""
    return 1.0 if support is None else float(support.double().mean())


def reach_of_rows(table: RayLines, support: Support | None) -> Reach:
    """Return the first column and that after the last where each row of the turned image has support, in any turn."""
    inside = np.full((table.rows, table.cols), support is None)
    if support is not None:
        for turn in table.turns:
            turned = np.rot90(support.numpy(), -turn)
            above, beside = ((size - part) // 2 for size, part in zip(inside.shape, turned.shape, strict=True))
            inside[above : above + turned.shape[0], beside : beside + turned.shape[1]] |= turned
    reach = np.full((table.rows, 2), (table.cols, 0), np.float32)
    some = inside.any(1)
    reach[some, 0] = inside[some].argmax(1)
    reach[some, 1] = table.cols - inside[some, ::-1].argmax(1)
    return reach


def reach_of_blocks(reach: Reach, rows: int, together: int) -> Reach:
    """Return the same for blocks of so many of the given number of rows; those beyond the image have nothing."""
    padded = np.full((-(-rows // together) * together, 2), (np.inf, 0), np.float32)
    padded[: len(reach)] = reach
    blocks = padded.reshape(-1, together, 2)
    return np.stack([blocks[..., 0].min(1), blocks[..., 1].max(1)], axis=1)
