"""Filtered back-projection of a cone beam whose focal spot goes round a circle: Feldkamp, Davis and Kress."""

from dataclasses import replace

import numpy as np
import torch

from pnpct.arrays import ConeRays, Volume
from pnpct.geometry import ConeBeam, Trajectory, VolumeGrid
from pnpct.operators import ConeBackprojector, ConeProjector, Kernel, Projector
from pnpct.operators.cone.cone_lines import seen_along_the_axis
from pnpct.physics import DiagonalWeights, Sinogram
from pnpct.reconstruction.bone import corrected_for_bone
from pnpct.reconstruction.filtered_views import FilteredViews, filtered_views
from pnpct.reconstruction.whole_object import beyond_fan, lines_left_out


def fdk(line_integrals: ConeRays, projector: ConeProjector, *, kernel: Kernel = "ram-lak") -> Volume:
    """Reconstruct by the method of Feldkamp, Davis and Kress: each row is filtered as that of a fan beam.

    With κ the angle by which a ray rises, each ray is weighted by cos κ; then weights, filter and 1/L² are those of
    `fbp`, seen along the axis, short scans included. Each voxel takes from each view the ray through it. This is exact
    in the plane of the circle, and where the object is the same in all slices; elsewhere it is approximate, the more
    so the steeper the rays. Voxels that a view does not see, near its focal spot above and below the cone, take the
    outermost row. Autograd works through it.

    Args:
        line_integrals: Measured line integrals; a full rotation, a short scan, or any set of views at one height.
        projector: The rays, the voxels, and the attenuation of water.
        kernel: "ram-lak", "shepp-logan", "hann" or "soft", from sharp to smooth.

    Returns:
        Volume relative to water.

    Raises:
        ValueError: If the kernel is unknown, or the fan opens beyond 45 degrees on a side.

    References:
        Feldkamp, Davis and Kress, J. Opt. Soc. Am. A 1 (1984) 612.
    """
    geometry = projector.geometry
    fan = seen_along_the_axis(geometry)
    rows = (line_integrals * _cosines(geometry).to(line_integrals)).transpose(-3, -2)
    volumes = (
        ConeBackprojector(projector.grid, _at_rest(geometry, views))(views(rows, kernel).transpose(-3, -2))
        * (views.scale / projector.mu_water)
        for views in filtered_views(fan)
    )
    return sum(volumes, start=next(volumes))


def circle_volume(sinogram: Sinogram, A: ConeProjector, kernel: Kernel) -> tuple[Volume, tuple[str, ...]]:
    """Return `fdk` and notes, after bone and what reaches beyond the fan are treated row by row, as `FBP` does."""
    weights, geometry = sinogram.weights, A.geometry
    assert isinstance(weights, DiagonalWeights)
    of_rows, diagonal = (array.transpose(-3, -2) for array in (sinogram.line_integrals, weights.diagonal))
    fan = Projector(A.grid.plane, seen_along_the_axis(geometry), mu_water=A.mu_water)
    rows = Sinogram(of_rows, DiagonalWeights(diagonal), sinogram.bone)
    whole = beyond_fan(corrected_for_bone(rows, fan), fan)
    wide = whole.A.geometry
    detector = replace(geometry.detector, bins=wide.bins, offset=wide.detector_offset)
    continued = ConeProjector(A.grid, replace(geometry, detector=detector), mu_water=A.mu_water)
    volume = fdk(whole.sinogram.line_integrals.transpose(-3, -2), continued, kernel=kernel)
    return volume, (*whole.notes, *lines_left_out(rows, fan.geometry))


def about_filtered_cone(geometry: ConeBeam, grid: VolumeGrid) -> str:
    """Say what readers of filtered back-projection of a cone beam should know."""
    if geometry.trajectory.feed:
        return (
            "Filtered back-projection of a helix is that of planes which are tilted with it; tv and pnp use all rays."
        )
    spots, nominal = geometry.focal_spots()[:, 2], geometry.trajectory.heights
    radius = min(grid.plane.radius, geometry.field_of_view_radius)
    nearest = (geometry.source_to_isocenter - radius) / geometry.source_to_detector
    edges = geometry.detector.row_edges[[0, -1]]
    low, high = (spots + (nominal + edge - spots) * nearest for edge in edges)
    said = f"Feldkamp's reconstruction is exact at z = {float(nominal.mean()):.4g} mm, and approximate away from there"
    if grid.heights[0] >= low.max() and grid.heights[-1] <= high.min():
        return f"{said}."
    return (
        f"{said}; below {float(low.max()):.4g} and above {float(high.min()):.4g} mm some views do not see the whole "
        "field of view, and their outermost row stands for what they miss."
    )


def _cosines(geometry: ConeBeam) -> torch.Tensor:
    """Return cos κ of each ray: (views, rows, bins)."""
    along = geometry.detector_points(geometry.fan_angles) - geometry.focal_spots()[:, None]
    rise = along[:, None, :, 2] + geometry.detector.row_positions[:, None]
    distance = np.linalg.norm(along[..., :2], axis=-1)[:, None]
    return torch.from_numpy(distance / np.hypot(distance, rise)).float()


def _at_rest(geometry: ConeBeam, views: FilteredViews) -> ConeBeam:
    """Return the rays of filtered views as a cone beam, in which the focal spot moves along z alone.

    Where it has moved away from the axis, it has from the detector too, whose cells span the same angles as before.
    """
    fan, chosen = views.fan, views.views.views
    distance = geometry.source_to_detector + fan.source_to_isocenter - geometry.source_to_isocenter
    detector = replace(
        geometry.detector,
        bins=fan.bins,
        bin_width=geometry.detector.bin_width * distance / geometry.source_to_detector,
        offset=fan.detector_offset,
    )
    up = [(0.0, 0.0, shift) for _, _, shift in geometry.trajectory.focal_spot_shifts]
    trajectory = Trajectory(fan.view_angles, geometry.trajectory.heights[chosen], [up[n] for n in chosen] if up else ())
    return ConeBeam(trajectory, detector, fan.source_to_isocenter, distance)
