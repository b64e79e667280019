"""Random changes after which anatomy is still anatomy and noise still has mean zero."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from torch import Tensor

from pnpct.arrays import Image


@dataclass(frozen=True)
class Augmentation:
    """Five changes of an image, the same for both images of a pair.

    Args:
        left_right: Whether it is mirrored from side to side.
        front_back: Whether it is mirrored from front to back.
        quarter_turns: Quarter turns, counter-clockwise.
        shift: Pixels by which rows and columns are moved, around the edges.
        scale: Factor of the attenuation; near 1.
    """

    left_right: bool
    front_back: bool
    quarter_turns: int
    shift: tuple[int, int]
    scale: float

    @staticmethod
    def drawn(draw: np.random.Generator, *, square: bool = True) -> "Augmentation":
        """Draw one: shifts up to 32 pixels, scales from 0.95 to 1.05; images that are not square make half turns."""
        left_right, front_back = (bool(draw.integers(2)) for _ in range(2))
        rows, cols = draw.integers(-32, 33, 2).tolist()
        turns = int(draw.integers(4))
        turns -= 0 if square else turns % 2
        return Augmentation(left_right, front_back, turns, (rows, cols), float(draw.uniform(0.95, 1.05)))

    def __call__(self, image: Image) -> Float[Tensor, "*batch new_rows new_cols"]:
        """Change an image."""
        flipped = [axis for axis, wanted in ((-1, self.left_right), (-2, self.front_back)) if wanted]
        turned = image.flip(flipped).rot90(self.quarter_turns, (-2, -1))
        return self.scale * turned.roll(self.shift, (-2, -1))


def change_alike(
    images: Sequence[Image], draw: np.random.Generator, *, augment: bool, side: int | None
) -> list[Float[Tensor, "*batch new_rows new_cols"]]:
    """Augment all images in the same way, and take the same patch from them.

    Args:
        images: Images of one size.
        draw: Generator of what is drawn.
        augment: Whether they are mirrored, turned, moved and scaled.
        side: Rows and columns of the patch; None takes whole images.

    Raises:
        ValueError: If the images are smaller than the patch.
    """
    changed = [*images]
    if augment:
        rows, cols = images[0].shape[-2:]
        change = Augmentation.drawn(draw, square=rows == cols)
        changed = [change(image) for image in changed]
    return changed if side is None else cut(changed, side, draw)


def cut(images: Sequence[Image], side: int, draw: np.random.Generator) -> list[Float[Tensor, "*batch side side"]]:
    """Take the same patch from all images, anywhere.

    Raises:
        ValueError: If the images are smaller than the patch.
    """
    rows, cols = images[0].shape[-2:]
    if not 1 <= side <= min(rows, cols):
        raise ValueError(f"A patch of {side} pixels cannot be taken from images of {rows} x {cols}.")
    row, col = int(draw.integers(rows - side + 1)), int(draw.integers(cols - side + 1))
    return [image[..., row : row + side, col : col + side] for image in images]
