"""From a scan with several detector rows to a volume, a few slices at a time."""

import math
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from itertools import chain

import numpy as np
import torch

from pnpct.arrays import Image, Volume
from pnpct.geometry import ConeBeam, ImageGrid, Plane, Rebinning, TiltedPlanes, VolumeGrid
from pnpct.geometry.plane_stack import Array, spanning
from pnpct.geometry.short_repr import short_repr
from pnpct.reconstruction.covered import check_covered, equal_parts, margin_of, plane_distance
from pnpct.reconstruction.parts import made_in_order
from pnpct.reconstruction.plane_images import PlaneImages, RaysOfViews
from pnpct.reconstruction.reconstructed import Method

SLAB = 8
"""Slices of a slab."""

_TAPS = 4
"""Planes between which a pixel is interpolated; two blur thin things along z, or want more planes."""


@dataclass(frozen=True, eq=False)
class Slab:
    """Some slices of a volume.

    Args:
        first: Number of the lowest of them in the volume.
        image: The slices, relative to water.
    """

    first: int
    image: Volume

    __repr__ = short_repr


def reconstruct_volume(
    rays: RaysOfViews,
    geometry: ConeBeam,
    grid: VolumeGrid,
    method: Method,
    *,
    mu_water: float,
    thickness: float = 0.0,
    plane_spacing: float | None = None,
    rebinning: Rebinning = "tilted",
    first: int = 0,
    slab: int = SLAB,
    processes: int = 1,
    cluster: str | None = None,
) -> Iterator[Slab]:
    """Reconstruct planes by a two-dimensional method, and yield the slices between them, from the lowest up.

    The planes are those of `TiltedPlanes`. They are reconstructed in groups that have one fan beam, and each pixel is
    interpolated along z by a cubic through four of them. What a slice is does not depend on `first` and `slab`, nor on
    who reconstructs the planes.

    At any time each process has in memory the rays of three quarters of a turn (of all views, of an axial scan), 16
    projectors, which all turns share (twice as many where bone is corrected), and what the method needs for one group
    of planes; this one has the images of the planes around a slice (15 at 20 mm a turn), and those that wait for one
    before them. With 984 x 900 rays a turn in 32 rows and 512 x 512 pixels that is about 170 + 400 + 15 MB, whatever
    the number of slices.

    Args:
        rays: The line integrals and weights of the views with the given numbers; it is asked for each view once, for a
            sixteenth of a turn at a time. Other processes need what can be pickled, here and for the method: values,
            classes and functions of modules.
        geometry: All views.
        grid: The slices.
        method: What makes the image of a plane.
        mu_water: Attenuation of water at the effective energy, 1/mm.
        thickness: Each slice is the mean over so many mm; 0 is as thin as the detector rows make it.
        plane_spacing: Largest distance between planes, mm, at least a hundredth of a detector row; half a row if None,
            and a whole one for slices of two rows or more. The method is called for each plane: twice the distance is
            half the time, and less resolution along z away from the axis.
        rebinning: "tilted", or "single-slice" as the control.
        first: Number of the slice to begin with.
        slab: Slices in what is yielded, at least 1; the last one may have fewer.
        processes: Processes that share the groups of planes, and the cores, at least 1; each asks for the rays anew.
        cluster: Address of the scheduler of a Dask cluster, whose workers take the place of these processes.

    Yields:
        The slices.

    Raises:
        OSError: If a process dies, or the cluster cannot be reached.
        ValueError: If an option is out of range, the scan does not cover a slice, or `rays` or `method` cannot be given
            to other processes.
    """
    if slab < 1:
        raise ValueError(f"A slab has at least one slice, got {slab}.")
    if processes < 1:
        raise ValueError(f"A volume needs at least one process, got {processes}.")
    planes = TiltedPlanes(geometry, rebinning)
    check_covered(planes, grid, thickness)
    spacing = plane_distance(planes, grid, thickness, plane_spacing)
    samples = _samples(planes, grid, thickness)
    slices = [grid.heights[number] + samples for number in range(first, grid.slices)]
    if not slices:
        return
    margin = margin_of(planes, grid.plane)
    beyond = margin + (spacing if planes.feed else 0.0)  # one plane more, for the cubic
    stacks = planes.stacks(
        grid.heights[0] + samples[0] - beyond,
        grid.heights[-1] + samples[-1] + beyond,
        spacing=spacing,
    )
    stacks = spanning(stacks, slices[0][0] - margin - (_TAPS - 1) * spacing, math.inf)
    images_of = PlaneImages(rays, planes, grid.plane, method, mu_water)
    made: list[Image] = []
    with closing(made_in_order(images_of, stacks, processes=processes, cluster=cluster)) as of_stacks:
        images = chain.from_iterable(
            zip(stack.planes, each.unbind(-3), strict=True) for stack, each in zip(stacks, of_stacks, strict=True)
        )
        for image in _between(images, slices, grid.plane, margin):
            made.append(image)
            if len(made) == slab:
                yield Slab(first, torch.stack(made, dim=-3))
                first, made = first + slab, []
    if made:
        yield Slab(first, torch.stack(made, dim=-3))


def _samples(planes: TiltedPlanes, grid: VolumeGrid, thickness: float) -> Array:
    """Heights at which a slice is sampled for its mean, relative to its middle, mm."""
    fine = (planes.geometry.row_height_at_isocenter or grid.slice_spacing) / 2
    number = equal_parts(thickness, fine)
    samples: Array = ((np.arange(number) + 0.5) / number - 0.5) * thickness
    return samples


def _between(
    images: Iterator[tuple[Plane, Image]], slices: Sequence[Array], grid: ImageGrid, margin: float
) -> Iterator[Image]:
    """Yield slices, each the mean over its heights of what lies between the planes; what is beyond is the last plane.

    Args:
        images: Planes and their images, from the lowest up.
        slices: For each slice its heights, mm.
        grid: The pixels.
        margin: How far a plane leaves its height on the axis, mm.
    """
    held: list[tuple[Plane, Image]] = []
    beside = _TAPS // 2
    for heights in slices:
        while len(held) < beside or held[-beside][0].z - margin < heights[-1]:
            if (following := next(images, None)) is None:
                break
            held.append(following)
        while len(held) > _TAPS and held[beside][0].z + margin < heights[0]:
            del held[0]
        yield torch.stack([_at(float(height), held, grid) for height in heights]).mean(0)


def _at(height: float, planes: Sequence[tuple[Plane, Image]], grid: ImageGrid) -> Image:
    """Interpolate along z at each pixel, by the polynomial through the planes around the height (Lagrange's)."""
    heights = np.stack([plane.heights(grid.x[None, :], grid.y[:, None]) for plane, _ in planes])
    images = torch.stack([image for _, image in planes])
    taps = min(_TAPS, len(planes))
    within = np.clip(height, heights[0], heights[-1])
    lowest = np.clip((heights <= within).sum(0) - taps // 2, 0, len(planes) - taps)
    near = np.stack([np.take_along_axis(heights, (lowest + tap)[None], 0)[0] for tap in range(taps)])
    total = torch.zeros_like(images[0])
    for tap in range(taps):
        others = np.delete(near, tap, 0)
        share = ((within - others) / (near[tap] - others)).prod(0)
        number = torch.from_numpy(lowest + tap).expand(1, *total.shape)
        total += torch.from_numpy(share).to(total) * images.gather(0, number)[0]
    return total
