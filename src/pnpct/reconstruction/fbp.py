"""Filtered back-projection of a fan beam, for any set of views."""

from functools import lru_cache

from pnpct.arrays import Image, Rays
from pnpct.geometry import FanBeam, ImageGrid
from pnpct.operators import FanBackprojector, Kernel, Projector
from pnpct.reconstruction.filtered_views import FilteredViews, filtered_views


def fbp(line_integrals: Rays, projector: Projector, *, kernel: Kernel = "ram-lak") -> Image:
    """Reconstruct by filtered back-projection.

    Each ray is weighted by cos γ and by the angle it represents (`ray_weights`); the views are convolved with the ramp
    of their detector and back-projected over L². Statistical weights are not used. Autograd works through it, any
    number of times, for networks that contain it.

        image = 1/mu_water Σ_β R^e / L² (h ∗ [weight · R cos γ · y])     e = 0 on an arc, 1 and D on a flat detector

    Args:
        line_integrals: Measured line integrals; a full rotation, a short scan, or any set of views. Lines that were not
            measured are taken from the nearest views. Where the focal spot moves, each view is interpolated to even
            angles about its own (`moving_spot`).
        projector: The rays, the pixels, and the attenuation of water.
        kernel: "ram-lak", "shepp-logan", "hann" or "soft", from sharp to smooth.

    Returns:
        Image relative to water.

    Raises:
        ValueError: If the kernel is unknown, or the fan opens beyond 45 degrees on a side.

    References:
        Kak and Slaney (2001), sections 3.4.1 and 3.4.2.
    """
    images = (
        back_project(views(line_integrals, kernel)) * (views.scale / projector.mu_water)
        for views, back_project in _prepare(projector.grid, projector.geometry)
    )
    return sum(images, start=next(images))


@lru_cache(maxsize=32)
def _prepare(grid: ImageGrid, geometry: FanBeam) -> list[tuple[FilteredViews, FanBackprojector]]:
    """Prepare each fan beam at rest; the planes of a volume have 16 geometries."""
    return [(views, FanBackprojector(grid, views.fan)) for views in filtered_views(geometry)]
