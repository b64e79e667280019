"""A picture of images side by side, each with its name and a detail."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from PIL import Image as Picture
from PIL import ImageDraw, ImageFont
from PIL.PngImagePlugin import PngInfo

from pnpct.arrays import Image
from pnpct.files import Provenance, atomic_path
from pnpct.units import to_hu

Greys = NDArray[np.uint8]

WINDOW = (30.0, 400.0)
"""Level and width, HU."""

SIDE = 512
"""Side of a panel in pixels of the picture."""

HEADER = 40
"""Height of the line with the names."""


def write_panels(path: Path, images: Mapping[str, Image], *, provenance: Provenance) -> None:
    """Write a PNG with images in a row under their names, and below them the middle ninth of each.

    Args:
        path: Where the picture shall be.
        images: Square images relative to water, by what shall stand above them.
        provenance: How they were made; it is kept in the picture.

    Raises:
        OSError: If the file cannot be written.
    """
    picture = Picture.new("L", (SIDE * len(images), HEADER + 2 * SIDE))
    draw, font = ImageDraw.Draw(picture), ImageFont.load_default(size=22)
    for number, (name, image) in enumerate(images.items()):
        left = number * SIDE
        draw.text((left + 12, HEADER // 2), name, fill=255, font=font, anchor="lm")
        third = slice(len(image) // 3, len(image) - len(image) // 3)
        for row, part in enumerate((image, image[third, third])):
            panel = Picture.fromarray(_greys(part)).resize((SIDE, SIDE), Picture.Resampling.BICUBIC)
            picture.paste(panel, (left, HEADER + row * SIDE))
    text = PngInfo()
    text.add_itxt("Comment", provenance.to_json())
    with atomic_path(path) as temporary:
        picture.save(temporary, pnginfo=text)


def _greys(image: Image) -> Greys:
    level, width = WINDOW
    shown = ((to_hu(image.double()) - level) / width + 0.5).clamp(0.0, 1.0)
    return np.asarray((255 * shown).round().to(torch.uint8))
