"""Iterations on the pixels that hold the object, without the air around it."""

from dataclasses import replace
from typing import TypeVar

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from pnpct.arrays import Image
from pnpct.denoisers import Gaussian
from pnpct.geometry import ImageGrid
from pnpct.reconstruction.fbp import fbp
from pnpct.reconstruction.half_resolution import CoarseImage, coarser_grid, doubled, halved
from pnpct.reconstruction.starting import far_apart
from pnpct.reconstruction.whole_object import Whole
from pnpct.reconstruction.whole_volume import WholeVolume

AnyWhole = TypeVar("AnyWhole", Whole, WholeVolume)

AIR = 0.1
"""What attenuates less than this part of water is air."""

BLUR = 1.0
"""Standard deviation of a blur, squares of four by four pixels, after which noise is less than that."""

MARGIN = 12
"""Pixels of air that stay beside the object."""

NEAR = 2.0
"""Squares of four by four pixels beside the border of what all views see."""

STEP = 8
"""Pixels that are left out on each side are multiples: squares stay whole, and transforms fast."""


def without_air(whole: Whole) -> Whole:
    """Leave out the pixels of air around the object that a smooth FBP image shows, as `without_air_of` does."""
    return without_air_of(fbp(whole.sinogram.line_integrals, whole.A, kernel="soft"), whole)


def without_air_of(image: Image, whole: AnyWhole) -> AnyWhole:
    """Leave out the pixels of air around the object, as many on opposite sides.

    The time of a data step, and of a network, goes with the number of pixels. What rays meet in those that are left out
    is what a first image has there: a couch, or foam, is not lost, nor taken for a part of the object. On a limited
    angle, and where views are far apart, all stays as it is, since there a first image is not to be trusted.

    Args:
        image: The first image, or volume.
        whole: The rays, and the pixels that hold the object.
    """
    A, plane = whole.A, whole.A.grid.plane
    half = coarser_grid(plane)
    coarse = coarser_grid(half)
    x, y = torch.from_numpy(coarse.x), torch.from_numpy(coarse.y.copy())
    # How far all views see a square; beyond, in the corners, a first image has what is not there.
    within = (A.geometry.field_of_view_radius - torch.hypot(x, y[:, None])) / coarse.spacing
    squares = Gaussian(BLUR)(halved(halved(image)) * (within > NEAR).to(image))  # no denoiser takes noise away there
    shape = _needed(squares, plane.shape, near=within < 2 * NEAR)
    if A.geometry.limited_angle or far_apart(A) or shape == plane.shape:
        return whole
    narrow = replace(plane, rows=shape[0], cols=shape[1])
    first = doubled(squares, half.shape)
    around = doubled(first, plane.shape)
    inside(first, coarser_grid(narrow)).zero_()
    rays = whole.sinogram.line_integrals - A.on(half)(first)
    return replace(whole, sinogram=replace(whole.sinogram, line_integrals=rays), A=A.on(narrow), around=around)


def inside(image: Image, plane: ImageGrid) -> Float[Tensor, "*batch fewer_rows fewer_cols"]:
    """Return the part in the middle of an image that has the pixels of a smaller grid; it shares their memory."""
    rows, cols = ((size - part) // 2 for size, part in zip(image.shape[-2:], plane.shape, strict=True))
    return image[..., rows : rows + plane.rows, cols : cols + plane.cols]


def _needed(
    squares: CoarseImage, shape: tuple[int, int], *, near: Bool[Tensor, "coarse_rows coarse_cols"]
) -> tuple[int, int]:
    """Rows and columns in the middle that hold the objects of all images of a batch, given in squares of pixels.

    An object near the border of what all views see may go on beyond it: then it may need all of them.
    """
    dense = (squares > AIR).reshape(-1, *squares.shape[-2:]).any(0).cpu()
    if not bool(dense.any()) or bool((dense & near).any()):
        return shape
    rows, cols = (
        _held(size, along.nonzero().flatten().tolist(), len(along))
        for size, along in zip(shape, (dense.any(1), dense.any(0)), strict=True)
    )
    return rows, cols


def _held(size: int, squares: list[int], of: int) -> int:
    """Pixels of a side that hold some of its squares, and a margin."""
    beside = 4 * min(squares[0], of - 1 - squares[-1]) - MARGIN
    return size - 2 * (max(beside, 0) // STEP * STEP)
