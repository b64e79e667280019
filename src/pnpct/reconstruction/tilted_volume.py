"""A volume on the slices of a cone beam's projector, made of planes: where iterations on a helix begin."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

from pnpct.arrays import Volume
from pnpct.geometry import TiltedPlanes, VolumeGrid
from pnpct.operators import AnyProjector, ConeProjector, Projector
from pnpct.physics import DiagonalWeights, Sinogram
from pnpct.reconstruction.bone import corrected_for_bone
from pnpct.reconstruction.covered import covered_slices
from pnpct.reconstruction.dead_modules import filled_from_image
from pnpct.reconstruction.reconstructed import Method, Progress, Reconstruction, unwatched
from pnpct.reconstruction.starting import starting_state
from pnpct.reconstruction.volume import reconstruct_volume
from pnpct.reconstruction.whole_object import beyond_fan, beyond_image
from pnpct.reconstruction.without_air import without_air


@dataclass(frozen=True)
class StartingImage:
    """The image that two-dimensional iterations begin from, as a method: `starting_state`."""

    @property
    def settings(self) -> Mapping[str, Any]:
        """What it is, as plain values."""
        return {"method": "start"}

    def __call__(self, sinogram: Sinogram, A: AnyProjector, *, progress: Progress = unwatched) -> Reconstruction:
        """Return it."""
        del progress
        assert isinstance(A, Projector)
        corrected = corrected_for_bone(filled_from_image(sinogram, A), A)
        whole, smooth = without_air(beyond_image(beyond_fan(corrected, A)))
        return Reconstruction(whole.cut_out(starting_state(whole.sinogram, whole.A, smooth).v), self.settings)


def tilted_volume(
    sinogram: Sinogram, A: ConeProjector, method: Method, *, plane_spacing: float | None = None
) -> Volume:
    """Reconstruct planes by a two-dimensional method, and return the slices of a projector between them.

    Slices that no plane covers, as there are at the ends of a scan, repeat the nearest that is covered.

    Args:
        sinogram: Line integrals and weights, one for each ray.
        A: The projector.
        method: What makes the image of a plane.
        plane_spacing: Largest distance between planes, mm, as for `reconstruct_volume`.

    Raises:
        ValueError: If the views cover no slice.
    """
    weights = sinogram.weights
    assert isinstance(weights, DiagonalWeights)

    def of_views(views: Sequence[int]) -> Sinogram:
        rays, diagonal = (array[..., list(views), :, :] for array in (sinogram.line_integrals, weights.diagonal))
        return Sinogram(rays, DiagonalWeights(diagonal, tuple(rays.shape[-3:])), sinogram.bone)

    grid = A.grid
    low, high = covered_slices(TiltedPlanes(A.geometry), grid.plane)
    step = grid.slice_spacing
    within = np.flatnonzero((grid.heights >= low) & (grid.heights <= high))
    heights = grid.heights[within] if within.size else np.array([np.clip(grid.z, low, high)])
    covered = VolumeGrid(grid.plane, len(heights), step, float(heights[[0, -1]].mean()))
    slabs = reconstruct_volume(
        of_views, A.geometry, covered, method, mu_water=A.mu_water, plane_spacing=plane_spacing, slab=len(heights)
    )
    volume = torch.cat([slab.image for slab in slabs], dim=-3)
    nearest = np.clip(np.rint((grid.heights - heights[0]) / step), 0, len(heights) - 1).astype(np.int64)
    return volume[..., nearest.tolist(), :, :]
