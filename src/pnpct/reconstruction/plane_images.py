"""Images of the planes of a volume."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TypeAlias

import numpy as np
import torch

from pnpct.arrays import Volume
from pnpct.geometry import FanBeam, ImageGrid, PlaneStack, TiltedPlanes
from pnpct.geometry.tilted_planes import WINDOWS
from pnpct.operators import Projector
from pnpct.physics import DiagonalWeights, Sinogram
from pnpct.reconstruction.reconstructed import Method
from pnpct.reconstruction.tilted_slices import rebinned

RaysOfViews: TypeAlias = Callable[[Sequence[int]], Sinogram]
"""From the numbers of views to their line integrals and weights: `lambda views: take_log(scan[views], ...)`."""


@dataclass(frozen=True, eq=False)
class PlaneImages:
    """From the planes of a stack to their images; what stacks share is made once.

    Args:
        rays: The line integrals and weights of views.
        planes: The planes of all views.
        grid: Pixels of a plane.
        method: What makes the image of a plane.
        mu_water: Attenuation of water at the effective energy, 1/mm.
    """

    rays: RaysOfViews
    planes: TiltedPlanes
    grid: ImageGrid
    method: Method
    mu_water: float

    def __call__(self, stack: PlaneStack) -> Volume:
        """Return the images of the planes of a stack, from the lowest up."""
        planes = self.planes
        views = planes.views(stack)
        parts = []
        for block in np.unique(planes.blocks(views)).tolist():
            measured = planes.views_of(block)
            wanted = torch.from_numpy(np.isin(measured, views))
            of_block = rebinned(self._sinogram_of(block), planes.geometry[measured], stack.planes)
            bone = self._sinogram_of(block).bone
            parts.append([values[..., wanted, :] for values in of_block])
        line_integrals, weights = (torch.cat(values, dim=-2) for values in zip(*parts, strict=True))
        sinogram = Sinogram(line_integrals, DiagonalWeights(weights), bone)
        return self.method(sinogram, self._projector(planes.fan(views))).image

    @cached_property
    def _projector(self) -> Callable[[FanBeam], Projector]:
        grid, mu_water = self.grid, self.mu_water  # without self, so that all goes when this does
        return lru_cache(maxsize=WINDOWS)(lambda fan: Projector(grid, fan, mu_water=mu_water))

    @cached_property
    def _sinogram_of(self) -> Callable[[int], Sinogram]:
        planes, rays = self.planes, self.rays
        of_views = lru_cache(maxsize=planes.most_blocks)
        return of_views(lambda block: rays(planes.views_of(block).tolist()))
