"""A fingerprint of an image that changes when one pixel does, and with nothing else."""

import hashlib
import struct

from pnpct.arrays import Image
from pnpct.geometry import ImageGrid


def image_sha256(image: Image, grid: ImageGrid) -> str:
    """Return the SHA-256 of the pixels of an image and of where they are.

    It is taken of the numbers and not of the file, whose compression and provenance may differ: of rows, columns
    (64-bit integers), spacing and centre (64-bit floats), then of the pixels row by row (32-bit floats), all
    little-endian. A NIfTI file keeps HU, rounded: take the fingerprint of what was read from it.

    Args:
        image: The image, relative to water; or another map on the grid.
        grid: Where its pixels are.

    Returns:
        64 hexadecimal digits.

    Example:
        >>> import torch
        >>> grid = ImageGrid(2, 2, spacing=1.0)
        >>> image_sha256(torch.ones(2, 2), grid) == image_sha256(torch.ones(2, 2), ImageGrid(2, 2, spacing=1.1))
        False
    """
    where = struct.pack("<2q3d", grid.rows, grid.cols, grid.spacing, *grid.center)
    pixels = image.detach().cpu().numpy().astype("<f4")
    return hashlib.sha256(where + pixels.tobytes()).hexdigest()
