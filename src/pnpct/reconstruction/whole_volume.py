"""Slices and pixels that hold all that the rays through a volume meet.

A ray of a cone beam that meets the slices that were asked for goes on beyond them. So slices are added on both sides,
as many as such rays reach, and rays that leave these too have the weight 0: what they meet outside is not known. That
holds for some slices in the middle of a patient as well as for those at the end of a scan.
"""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor

from pnpct.arrays import Volume
from pnpct.geometry import VolumeGrid, rays_inside, slices_beyond
from pnpct.geometry.short_repr import short_repr
from pnpct.operators import ConeProjector, Projector
from pnpct.operators.cone.cone_lines import seen_along_the_axis
from pnpct.physics import DiagonalWeights, Sinogram
from pnpct.reconstruction.bone import with_bone_of
from pnpct.reconstruction.whole_object import beyond_fan, beyond_image, part_of, surrounded

LOOKED_AT = 96
"""Views in whose middle row it is seen whether the object is in the image."""


@dataclass(frozen=True, eq=False)
class WholeVolume:
    """A sinogram and a projector whose voxels hold what the rays meet.

    Args:
        sinogram: Line integrals and weights; these are 0 for rays that leave the volume.
        A: The projector.
        asked: The grid that was asked for, in the middle of that of the projector.
        notes: What was done, in sentences.
        around: What lies around the support of the projector, on more pixels of each slice; None if nothing does.
    """

    sinogram: Sinogram
    A: ConeProjector
    asked: VolumeGrid
    notes: tuple[str, ...] = ()
    around: Volume | None = None

    __repr__ = short_repr

    def cut_out(self, volume: Volume) -> Float[Tensor, "*batch asked_slices asked_rows asked_cols"]:
        """Return the slices, and the part of them, that were asked for."""
        volume, plane = surrounded(volume, self.A.grid.plane, self.around, self.A.support)
        beyond = (self.A.grid.slices - self.asked.slices) // 2
        slices = volume[..., beyond : beyond + self.asked.slices, :, :]
        return part_of(slices, plane, self.asked.plane)


def whole_volume(sinogram: Sinogram, A: ConeProjector) -> WholeVolume:
    """Add the slices that rays reach, and the pixels that hold the object, and leave out rays that still go beyond.

    Raises:
        ValueError: If the weights are not one for each ray, no ray stays inside, or the object needs too many pixels.
    """
    of_rays = weights_of_rays(sinogram)
    geometry, asked = A.geometry, A.grid
    step = max(1, geometry.views // LOOKED_AT)
    middle = sinogram.line_integrals[..., ::step, geometry.rows // 2, :]
    fan = seen_along_the_axis(geometry[::step])
    of_middle = Sinogram(middle, DiagonalWeights(torch.ones_like(middle)))
    in_plane = beyond_image(beyond_fan(of_middle, Projector(asked.plane, fan, mu_water=A.mu_water)))
    wide = replace(asked, plane=in_plane.A.grid)
    grid = replace(wide, slices=asked.slices + 2 * slices_beyond(wide, geometry))
    inside = torch.from_numpy(rays_inside(grid, geometry)).to(sinogram.line_integrals.device)
    weights = DiagonalWeights(of_rays.diagonal * inside, geometry.shape)
    projector = ConeProjector(grid, geometry, mu_water=A.mu_water)
    return WholeVolume(replace(sinogram, weights=weights), projector, asked, in_plane.notes)


def weights_of_rays(sinogram: Sinogram) -> DiagonalWeights:
    """Return the weights of a sinogram, one for each ray.

    Raises:
        ValueError: If they are correlated.
    """
    if not isinstance(sinogram.weights, DiagonalWeights):
        raise ValueError(
            "The rays of a cone beam need weights of their own, got correlated ones; give DiagonalWeights."
        )
    return sinogram.weights


def corrected_for_bone_in(volume: Volume, whole: WholeVolume) -> WholeVolume:
    """Return line integrals, and their weights, as `corrected_for_bone` does, by a first volume."""
    if whole.A.geometry.limited_angle:
        return replace(whole, sinogram=replace(whole.sinogram, bone=None))
    return replace(whole, sinogram=with_bone_of(volume, whole.sinogram, whole.A))
