"""Iterations on the pixels that hold the object, without the air around it."""

import math
from dataclasses import replace
from typing import TypeVar

import numpy as np
import torch
from jaxtyping import Bool, Float, Shaped
from torch import Tensor

from pnpct.arrays import Image, Support
from pnpct.denoisers import Gaussian
from pnpct.denoisers.learned import DENSEST
from pnpct.geometry import ImageGrid
from pnpct.operators.support import supported
from pnpct.reconstruction.fbp import fbp
from pnpct.reconstruction.half_resolution import coarser_grid, doubled, halved
from pnpct.reconstruction.starting import far_apart
from pnpct.reconstruction.whole_object import Whole
from pnpct.reconstruction.whole_volume import WholeVolume

AnyWhole = TypeVar("AnyWhole", Whole, WholeVolume)

AIR = 0.1
"""What attenuates less than this part of water is air."""

BLUR = 1.0
"""Standard deviation of a blur, squares of four by four pixels, after which noise is less than that."""

MARGIN = 16
"""Pixels of air that stay beside the object."""

NEAR = 2.0
"""Squares of four by four pixels beside the border of what all views see."""

DIRECTIONS = tuple((math.cos(angle), math.sin(angle)) for angle in np.arange(32) * (2 * math.pi / 32))
"""In which tangents of the object are drawn; the first goes along the rows, and every eighth a quarter turn on."""

STEP = 8
"""Pixels that are left out on each side are multiples: squares stay whole, and transforms fast."""


def without_air(whole: Whole) -> tuple[Whole, Image]:
    """Leave out the pixels of air around the object that a smooth FBP image shows, as `without_air_of` does.

    Returns:
        The rays, and the pixels that hold the object; and that image on these.
    """
    smooth = fbp(whole.sinogram.line_integrals, whole.A, kernel="soft")
    narrow = without_air_of(smooth, whole)
    return narrow, supported(inside(smooth, narrow.A.grid), narrow.A.support).contiguous()


def without_air_of(image: Image, whole: AnyWhole) -> AnyWhole:
    """Leave out the pixels of air around the object, as many on opposite sides.

    The time of a data step, and of a network, goes with the number of pixels. What rays meet in those that are left out
    is what a first image has there: a couch, or foam, is not lost, nor taken for a part of the object. On a limited
    angle, and where views are far apart, all stays as it is, since there a first image is not to be trusted; and with
    metal, whose streaks go on around the object.

    Args:
        image: The first image, or volume.
        whole: The rays, and the pixels that hold the object.
    """
    A, plane = whole.A, whole.A.grid.plane
    half = coarser_grid(plane)
    coarse = coarser_grid(half)
    x, y = torch.from_numpy(coarse.x), torch.from_numpy(coarse.y.copy())[:, None]
    # How far all views see a square; beyond, in the corners, a first image has what is not there.
    within = (A.geometry.field_of_view_radius - torch.hypot(x, y)) / coarse.spacing
    means = halved(halved(image)) * (within > NEAR).to(image)  # no denoiser takes noise away beyond
    squares = Gaussian(BLUR)(means)
    dense = (squares > AIR).reshape(-1, *coarse.shape).any(0).cpu()
    # An object near the border of what all views see may go on beyond it.
    unsure = A.geometry.limited_angle or far_apart(A) or bool((dense & (within < 2 * NEAR)).any())
    if unsure or not bool(dense.any()) or bool((means > DENSEST).any()):
        return whole
    tangents = _tangents(dense, coarse, plane)
    narrow = _narrower(plane, tangents)
    kept = _between(tangents, coarse, plane)
    support = inside(kept.repeat_interleave(4, 0).repeat_interleave(4, 1)[: plane.rows, : plane.cols], narrow)
    if narrow == plane and bool(support.all()):
        return whole
    rays = whole.sinogram.line_integrals - A.on(coarse)(squares.where(~kept.to(image.device), 0))
    around = doubled(doubled(squares, half.shape), plane.shape)
    sinogram = replace(whole.sinogram, line_integrals=rays)
    return replace(whole, sinogram=sinogram, A=A.on(narrow, support.contiguous()), around=around)


def inside(image: Image | Support, plane: ImageGrid) -> Shaped[Tensor, "*batch fewer_rows fewer_cols"]:
    """Return the part in the middle of an image that has the pixels of a smaller grid; it shares their memory."""
    rows, cols = ((size - part) // 2 for size, part in zip(image.shape[-2:], plane.shape, strict=True))
    return image[..., rows : rows + plane.rows, cols : cols + plane.cols]


def _tangents(dense: Bool[Tensor, "coarse_rows coarse_cols"], coarse: ImageGrid, plane: ImageGrid) -> list[float]:
    """How far squares that hold the object reach in each of the `DIRECTIONS` from the middle of a plane, and a margin.

    Returns:
        Pixels of the plane.
    """
    rows, cols = dense.nonzero(as_tuple=True)
    x, y = _from_middle(coarse, plane)
    half = coarse.spacing / plane.spacing / 2
    return [float((c * x[cols] + s * y[rows]).max()) + half * (abs(c) + abs(s)) + MARGIN for c, s in DIRECTIONS]


def _narrower(plane: ImageGrid, tangents: list[float]) -> ImageGrid:
    """Return the pixels in the middle of a plane that hold the object, in steps of `STEP` on each side."""
    right, up, left, down = tangents[:: len(tangents) // 4]
    rows, cols = (
        size - 2 * (int(max(size / 2 - reach, 0)) // STEP * STEP)
        for size, reach in zip(plane.shape, (max(up, down), max(left, right)), strict=True)
    )
    return replace(plane, rows=rows, cols=cols)


def _between(tangents: list[float], coarse: ImageGrid, plane: ImageGrid) -> Bool[Tensor, "coarse_rows coarse_cols"]:
    """Return the squares whose middle lies between the tangents."""
    x, y = _from_middle(coarse, plane)
    within = (c * x + s * y[:, None] <= reach for (c, s), reach in zip(DIRECTIONS, tangents, strict=True))
    return torch.stack([*within]).all(0)


def _from_middle(coarse: ImageGrid, plane: ImageGrid) -> tuple[Float[Tensor, " cols"], Float[Tensor, " rows"]]:
    """Return how far columns and rows of squares are from the middle of a plane, in pixels of it."""
    x, y = (coarse.x - plane.center[0]) / plane.spacing, (coarse.y - plane.center[1]) / plane.spacing
    return torch.from_numpy(x), torch.from_numpy(y)
