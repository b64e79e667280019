"""From a scan with several detector rows to a volume by the projector of its cone beam, slab by slab."""

import math
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
import torch
from numpy.typing import NDArray

from pnpct.arrays import Volume
from pnpct.geometry import ConeBeam, TiltedPlanes, VolumeGrid, views_meeting
from pnpct.operators import ConeProjector
from pnpct.physics import DiagonalWeights, Sinogram
from pnpct.reconstruction.covered import check_covered, equal_parts, margin_of
from pnpct.reconstruction.parts import made_in_order
from pnpct.reconstruction.plane_images import RaysOfViews
from pnpct.reconstruction.reconstructed import Method
from pnpct.reconstruction.volume import Slab
from pnpct.reconstruction.whole_volume import weights_of_rays

SLICES_OF_A_SLAB = 48
"""Slices that are reconstructed together, besides those that rays reach beyond them."""

_TOGETHER = 256
"""Views whose counts become line integrals together."""

Slices: TypeAlias = tuple[int, int]
"""Numbers of the first slice, and of the one after the last."""


def reconstruct_cone_volume(
    rays: RaysOfViews,
    geometry: ConeBeam,
    grid: VolumeGrid,
    method: Method,
    *,
    mu_water: float,
    thickness: float = 0.0,
    first: int = 0,
    processes: int = 1,
    cluster: str | None = None,
) -> Iterator[Slab]:
    """Reconstruct a volume by the projector of its cone beam, and yield it in slabs, from the lowest up.

    A slab is reconstructed with the views whose rays meet it, and with as many slices beyond it as these rays reach, so
    that slabs do not know of one another, and what a slice is does not depend on `first`. Slices are as thin as a
    detector row at the isocentre or thinner, up to a hundredth; thicker ones are means over several.

    Each process has in memory the rays and weights of the views of a slab, some times over, and ten volumes of its
    slices and those beyond it. With 984 x 900 rays a turn in 32 rows and 512 x 512 pixels of a slab of 48 slices, that
    is some 5 GiB, whatever the number of slices.

    Args:
        rays: The line integrals and weights of the views with the given numbers. Other processes need what can be
            pickled, here and for the method: values, classes and functions of modules.
        geometry: All views.
        grid: The slices.
        method: What makes a volume of a sinogram and a `ConeProjector`: all of `METHODS` do.
        mu_water: Attenuation of water at the effective energy, 1/mm.
        thickness: Each slice is the mean over so many mm; 0 is as thin as they are reconstructed.
        first: Number of the slice to begin with.
        processes: Processes that share the slabs, and the cores, at least 1.
        cluster: Address of the scheduler of a Dask cluster, whose workers take the place of these processes.

    Yields:
        The slices.

    Raises:
        OSError: If a process dies, or the cluster cannot be reached.
        ValueError: If an option is out of range, the scan does not cover a slice, or `rays` or `method` cannot be given
            to other processes.
    """
    check_covered(TiltedPlanes(geometry), grid, thickness)
    make = ConeSlabs(rays, geometry, grid, method, mu_water, thickness)
    together = slices_together(grid, geometry)
    begin = first // together * together
    parts = [(number, min(number + together, grid.slices)) for number in range(begin, grid.slices, together)]
    with closing(made_in_order(make, parts, processes=processes, cluster=cluster)) as volumes:
        for (number, _), volume in zip(parts, volumes, strict=True):
            done = max(first - number, 0)
            yield Slab(number + done, volume[..., done:, :, :])


def slices_together(grid: VolumeGrid, geometry: ConeBeam) -> int:
    """Return how many of the slices that are asked for make a slab."""
    return max(1, SLICES_OF_A_SLAB // _thin_slices(grid, geometry))


def slice_distance(grid: VolumeGrid, geometry: ConeBeam) -> float:
    """Return the distance between the slices that are reconstructed, mm: a detector row at the isocentre, or less."""
    return grid.slice_spacing / _thin_slices(grid, geometry)


@dataclass(frozen=True, eq=False)
class ConeSlabs:
    """From the numbers of slices to their volume.

    Args:
        rays: The line integrals and weights of views.
        geometry: All views.
        grid: The slices that are asked for.
        method: What makes a volume of rays.
        mu_water: Attenuation of water at the effective energy, 1/mm.
        thickness: Of each slice, mm.
    """

    rays: RaysOfViews
    geometry: ConeBeam
    grid: VolumeGrid
    method: Method
    mu_water: float
    thickness: float

    def __call__(self, slices: Slices) -> Volume:
        """Return these slices."""
        heights = self.grid.heights[slice(*slices)]
        distance = slice_distance(self.grid, self.geometry)
        share = _shares(self.thickness / distance)
        side, each = len(share) // 2, _thin_slices(self.grid, self.geometry)
        thin = replace(
            self.grid,
            slices=(len(heights) - 1) * each + len(share),
            slice_spacing=distance,
            z=float(heights[[0, -1]].mean()),
        )
        views = views_meeting(thin, self.geometry, within=_of_planes(thin, self.geometry))
        A = ConeProjector(thin, self.geometry[views], mu_water=self.mu_water)
        volume = self.method(self._rays_of(views), A).image
        middles = range(side, thin.slices - side, each)
        means = [
            torch.tensordot(volume[..., middle - side : middle + side + 1, :, :].movedim(-3, -1), share.to(volume), 1)
            for middle in middles
        ]
        return torch.stack(means, dim=-3)

    def _rays_of(self, views: NDArray[np.int64]) -> Sinogram:
        """The rays of views, some views at a time: on the way to them there are many more arrays."""
        parts = [self.rays(views[first : first + _TOGETHER].tolist()) for first in range(0, len(views), _TOGETHER)]
        line_integrals = torch.cat([part.line_integrals for part in parts], dim=-3)
        weights = torch.cat([weights_of_rays(part).diagonal for part in parts], dim=-3)
        return Sinogram(line_integrals, DiagonalWeights(weights, tuple(line_integrals.shape[-3:])), parts[0].bone)


def _thin_slices(grid: VolumeGrid, geometry: ConeBeam) -> int:
    """How many slices are reconstructed for one that is asked for."""
    return equal_parts(grid.slice_spacing, geometry.row_height_at_isocenter or grid.slice_spacing)


def _shares(thickness: float) -> torch.Tensor:
    """Return the shares of an odd number of neighbouring slices in their mean over a thickness, in slices."""
    thickness = max(thickness, 1.0)
    side = math.ceil((thickness - 1) / 2 - 1e-9)
    away: NDArray[np.float64] = np.abs(np.arange(-side, side + 1))
    return torch.from_numpy(np.clip(thickness / 2 + 0.5 - away, 0.0, 1.0) / thickness)


def _of_planes(grid: VolumeGrid, geometry: ConeBeam) -> float:
    """How far the views of a plane may be from the slices it is for, mm: iterations on a helix begin from planes."""
    planes = TiltedPlanes(geometry)
    return abs(planes.feed) * (geometry.short_scan / (4 * math.pi) + 1 / 8) + margin_of(planes, grid.plane)
