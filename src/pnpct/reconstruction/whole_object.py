"""Rays and pixels that hold the whole object, where it reaches beyond the fan or beyond the image.

The methods need the whole object, whatever part of it is asked for. Where projections are cut off at the end of the
fan, FBP makes a bright rim; iterative methods explain by the pixels they have all that the rays have seen.
"""

import math
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
import torch
from jaxtyping import Bool, Float
from numpy.typing import NDArray
from torch import Tensor
from torch.nn.functional import max_pool2d, pad

from pnpct.arrays import Image, Rays, Support
from pnpct.geometry import FanBeam, ImageGrid
from pnpct.geometry.short_repr import short_repr
from pnpct.operators import Projector
from pnpct.physics import DiagonalWeights, Sinogram
from pnpct.reconstruction.half_resolution import coarser_grid, halved

WholeImage: TypeAlias = Float[Tensor, "*batch whole_rows whole_cols"]
"""An image on all pixels that hold the object, and those of air around it."""

AIR = 0.2
"""Line integral that air and noise do not have: 10 mm of water."""

NEIGHBOURS = (3, 5)
"""Views and bins whose mean is compared with air."""

FEW = 0.01
"""Share of the views in which an object may be seen somewhere by mistake."""

FULL = math.radians(12)
"""Largest step between the views of a full turn."""

FITTED = 8
"""Bins at the end of the fan that its continuation is fitted to."""

REACH, WIDEST = 1.6, 0.6
"""How far the object is followed at most, in radii of the field of view and in distances of the focal spot."""

RIM = 4
"""Pixels of air at the border of the support, of which a network, which sees nothing beyond, makes 5 HU."""

LARGEST = 4096**2
"""Pixels of the largest image that is reconstructed for the sake of a part of it."""


@dataclass(frozen=True, eq=False)
class Whole:
    """A sinogram and a projector whose rays and pixels hold the object.

    Args:
        sinogram: Line integrals and weights; these are 0 for rays that were added.
        A: The projector; its pixels are as large as those asked for, or half as large.
        asked: The grid that was asked for, within that of the projector.
        notes: What was done, in sentences.
        around: What lies around the support of the projector, on more pixels; None if nothing does.
    """

    sinogram: Sinogram
    A: Projector
    asked: ImageGrid
    notes: tuple[str, ...] = ()
    around: Image | None = None

    __repr__ = short_repr

    def cut_out(self, image: Image) -> Float[Tensor, "*batch asked_rows asked_cols"]:
        """Return the part of an image that was asked for, in pixels of the size that was asked for."""
        (image, grid), asked = surrounded(image, self.A.grid, self.around, self.A.support), self.asked
        if grid.spacing < asked.spacing:
            image, grid = halved(image), coarser_grid(grid)
        return part_of(image, grid, asked)


def surrounded(
    image: Image, grid: ImageGrid, around: WholeImage | None, support: Support | None
) -> tuple[WholeImage, ImageGrid]:
    """Return an image, less the rim of its support, within what lies around it, and the grid of both."""
    if around is None or support is None:
        return image, grid
    rows, cols = around.shape[-2:]
    top, left = (rows - grid.rows) // 2, (cols - grid.cols) // 2
    beside = (left, cols - grid.cols - left, top, rows - grid.rows - top)
    left_out, padded = pad(~support, beside, value=True), pad(image, beside)
    near = max_pool2d(left_out.to(image)[None], 2 * RIM + 1, stride=1, padding=RIM)[0] > 0
    return padded.where(~near, around), replace(grid, rows=rows, cols=cols)


def part_of(image: Image, grid: ImageGrid, asked: ImageGrid) -> Float[Tensor, "*batch asked_rows asked_cols"]:
    """Return the part of an image on one grid that another, which lies within it, has."""
    if grid == asked:
        return image
    row = round((grid.y[0] - asked.y[0]) / asked.spacing)
    col = round((asked.x[0] - grid.x[0]) / asked.spacing)
    return image[..., row : row + asked.rows, col : col + asked.cols]


def beyond_fan(sinogram: Sinogram, A: Projector) -> Whole:
    """Continue projections that are cut off at an end of the fan, as those of a cylinder of water.

    With s the distance of a ray from the isocentre, the p² of a cylinder is a parabola in s of the curvature
    −8 mu_water²; its other two coefficients are fitted to the last bins of each view. The rays that are added have the
    weight 0. Where nothing is cut off all stays as it is, and so does the shorter side of a detector that is moved
    aside, whose lines the longer side has measured.

    References:
        Hsieh et al., Med. Phys. 31 (2004) 2385.
    """
    p, W, geometry = sinogram.line_integrals, sinogram.weights, A.geometry
    before, after = _bins_beyond(geometry)
    if geometry.bins < FITTED or not isinstance(W, DiagonalWeights):
        return Whole(sinogram, A, A.grid)
    end = NEIGHBOURS[1] // 2 + 1  # so many bins decide about the outermost
    low = _through_object(p[..., :end])[..., 0] & (before > 0)
    high = _through_object(p[..., -end:])[..., -1] & (after > 0)
    share = float((low | high).double().mean())
    if share <= FEW:
        return Whole(sinogram, A, A.grid)
    wide = geometry.widened(before, after)
    s = torch.from_numpy(geometry.source_to_isocenter * np.sin(wide.fan_angles)).to(p)
    at = torch.tensor_split(s, (before, before + geometry.bins))
    to_low = _of_water(p.flip(-1), -at[1].flip(0), -at[0].flip(0), low, A.mu_water).flip(-1)
    to_high = _of_water(p, at[1], at[2], high, A.mu_water)
    weights = pad(W.diagonal, (before, after))
    note = (
        f"The object reaches beyond the fan in {share:.0%} of the views; these were continued as those of water, and "
        "HU are uncertain near the edge of what the fan covers."
    )
    continued = Sinogram(torch.cat([to_low, p, to_high], dim=-1), DiagonalWeights(weights, wide.shape))
    return Whole(continued, Projector(A.grid, wide, mu_water=A.mu_water, method=A.method), A.grid, (note,))


def beyond_image(whole: Whole) -> Whole:
    """Add pixels around an image that rays through the object miss, of the same size, so that they hold the object.

    An image that no such ray misses stays as it is. The object is sought within a circle about the isocentre.

    Raises:
        ValueError: If the object needs too many pixels of this size, or pixels that are too large.
    """
    A, grid, geometry = whole.A, whole.A.grid, whole.A.geometry
    p = whole.sinogram.line_integrals
    missing = _mean(torch.from_numpy(_misses(grid, geometry)).to(p)) == 1
    if not bool(missing.any()):
        return whole
    through = _through_object(p).reshape(-1, *geometry.shape).any(0)
    if float((through & missing).double().mean(0).max()) <= FEW:
        return whole
    bins = (through.double().mean(0) > FEW).cpu().numpy()
    reach = geometry.source_to_isocenter * float(np.abs(np.sin(geometry.fan_angles[bins])).max())
    wide = _around(grid, min(reach + geometry.bin_width_at_isocenter, WIDEST * geometry.source_to_isocenter))
    if wide.radius >= geometry.source_to_isocenter:
        raise ValueError(
            f"Pixels of {grid.spacing:.4g} mm are too large for an object of {2 * reach:.4g} mm: so many as hold it "
            "reach the focal spot; ask for smaller ones, or for FBP."
        )
    if wide.rows * wide.cols > LARGEST:
        raise ValueError(
            f"An object of {2 * reach:.4g} mm needs an image of {wide.rows} x {wide.cols} pixels of {grid.spacing:.4g} "
            "mm, of which a part was asked for; ask for larger pixels, or for FBP."
        )
    note = (
        f"Rays through the object miss the image; {wide.rows} x {wide.cols} pixels were reconstructed, and the part "
        "that was asked for cut out."
    )
    return replace(whole, A=A.on(wide), notes=(*whole.notes, note))


def lines_left_out(sinogram: Sinogram, geometry: FanBeam) -> tuple[str, ...]:
    """Say that no ray measured some lines through the object: of a limited angle, or where the detector is moved aside.

    Lines beyond the shorter side of the fan are measured once in a turn.
    """
    if geometry.limited_angle:
        directions = np.sort(np.mod(geometry.view_angles, math.pi))
        missing = math.degrees(float(np.diff(directions, append=directions[0] + math.pi).max()))
        return (
            f"The views leave out {missing:.0f} of 180 degrees of directions, and FBP has streaks and shading; "
            "try tv or pnp.",
        )
    angles = np.sort(np.mod(geometry.view_angles, 2 * math.pi))
    gap = float(np.diff(angles, append=angles[0] + 2 * math.pi).max())
    shorter = min(-geometry.fan_angle_edges[0], geometry.fan_angle_edges[-1])
    once = np.abs(geometry.fan_angles) > shorter + geometry.bin_width / geometry.source_to_detector
    if gap <= FULL or not once.any():
        return ()
    seen = float(_through_object(sinogram.line_integrals)[..., torch.from_numpy(once)].double().mean())
    if seen <= FEW:
        return ()
    return (
        f"The detector is moved aside, which needs a full turn, but the views leave out {math.degrees(gap):.0f} "
        "degrees: lines through the object were not measured, and FBP has streaks; try tv.",
    )


def _bins_beyond(geometry: FanBeam) -> tuple[int, int]:
    """How many bins there may be beyond each end of the fan; none beyond the shorter one."""
    position = np.tan if geometry.detector == "flat" else np.positive
    ends = (-geometry.fan_angle_edges[0], geometry.fan_angle_edges[-1])
    pitch = sum(map(position, ends)) / geometry.bins
    reach = math.asin(min(REACH * geometry.field_of_view_radius / geometry.source_to_isocenter, WIDEST))
    before, after = (
        int(max(position(reach) - position(end), 0) / pitch) if position(max(ends)) - position(end) < 1.5 * pitch else 0
        for end in ends
    )
    return before, after


def _misses(grid: ImageGrid, geometry: FanBeam) -> NDArray[np.bool_]:
    """Which rays pass an image by: its middle is farther from them than any of its corners is from its middle."""
    spots = geometry.focal_spots()[:, None]
    along = geometry.detector_points(geometry.fan_angles) - spots
    distance = along[..., 1] * (grid.center[0] - spots[..., 0]) - along[..., 0] * (grid.center[1] - spots[..., 1])
    reach = grid.cols * np.abs(along[..., 1]) + grid.rows * np.abs(along[..., 0])
    answer: NDArray[np.bool_] = np.abs(distance) > grid.spacing / 2 * reach
    return answer


def _mean(rays: Rays) -> Rays:
    """Means over neighbouring rays."""
    images = rays.reshape(-1, 1, *rays.shape[-2:])
    around = (NEIGHBOURS[0] // 2, NEIGHBOURS[1] // 2)
    means = torch.nn.functional.avg_pool2d(images, NEIGHBOURS, stride=1, padding=around, count_include_pad=False)
    return means.reshape(rays.shape)


def _through_object(line_integrals: Rays) -> Bool[Tensor, "*batch views bins"]:
    return _mean(line_integrals) > AIR


def _of_water(
    p: Rays,
    inside: Float[Tensor, " bins"],
    outside: Float[Tensor, " added"],
    cut_off: Bool[Tensor, "*batch views"],
    mu_water: float,
) -> Float[Tensor, "*batch views added"]:
    """Continue rays beyond their last bin; all distances grow towards it, mm."""
    last, s = p[..., -FITTED:], inside[-FITTED:]
    curvature, middle = (2 * mu_water) ** 2, s.mean()
    line = last.square() + curvature * s.square()
    slope = (line * (s - middle)).sum(-1, keepdim=True) / (s - middle).square().sum()
    squared = line.mean(-1, keepdim=True) + slope * (outside - middle) - curvature * outside.square()
    number = torch.arange(len(outside)).to(p) / max(len(outside), 1)
    taper = torch.cos((4 * number - 3).clamp_min(0) * (math.pi / 2)).square()  # of an object that does not end
    continued: Tensor = squared.clamp_min(0).sqrt() * taper * cut_off[..., None]
    return continued


def _around(grid: ImageGrid, radius: float) -> ImageGrid:
    """The pixels of a grid, and more of them on all sides, so that they hold a circle about the isocentre."""
    ends = (grid.x[0], -grid.x[-1], -grid.y[0], grid.y[-1])
    left, right, top, bottom = (max(math.ceil((end + radius) / grid.spacing - 0.5), 0) for end in ends)
    center = (
        grid.center[0] + (right - left) / 2 * grid.spacing,
        grid.center[1] + (top - bottom) / 2 * grid.spacing,
    )
    return ImageGrid(grid.rows + top + bottom, grid.cols + left + right, grid.spacing, center)
