"""Contrast recovery: how much of a lesion that was put into the data survives the reconstruction."""

import math
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from pnpct.evaluation.data.realisations import ray_weights
from pnpct.geometry import ImageGrid, Lesion, disc_mask
from pnpct.operators import Projector
from pnpct.physics import DiagonalWeights, Sinogram

CORE = 0.6
"""Radius of the core over that of the lesion: away from the blur of its edge."""

RING = (1.25, 2.0)
"""Radii of the ring around the lesion over its own."""

DISTANT = 20.0
"""What is farther from the outline than this, in mm, should not change at all."""


@dataclass(frozen=True)
class LesionRecovery:
    """What a lesion in the data did to the image.

    Args:
        lesion: What was put in.
        recovered: Contrast recovery coefficient: mean change in the core over the contrast. 1 is all of it, 0 a lesion
            that was erased.
        spill: Mean change in a ring from 1.25 to 2 radii over the contrast; 0 for a sharp image.
        distant_hu: Root mean square change farther than 20 mm from the outline, HU.
    """

    lesion: Lesion
    recovered: float
    spill: float
    distant_hu: float


def insert_lesion(sinogram: Sinogram, projector: Projector, lesion: Lesion) -> Sinogram:
    """Put a lesion into line integrals, in the slice through its middle: y + A L, weights · exp(−A L).

    The noise stays the same draw, so that images with and without differ by the lesion alone. The weights follow the
    quanta that the lesion takes away; electronic noise would take more of the faintest rays' weights (up to the square
    of the factor), and noise itself would grow by half as much: below 1 % for 50 HU and 20 mm. Line integrals must be
    those of the projector, corrected for beam hardening; scans with and without the lesion, drawn with one seed, are
    the better data where they can be made.

    Args:
        sinogram: The data without it.
        projector: A.
        lesion: What is added to what is there; it must lie on the projector's grid.

    Returns:
        The data with it.

    Raises:
        ValueError: If the lesion is not wholly on the grid, or the noise of the rays is correlated.

    References:
        Chen et al., Med. Phys. 42 (2015) 7034; Acad. Radiol. 23 (2016) 1221: readers cannot tell such lesions from
        real ones.
    """
    _check_inside(lesion, projector.grid)
    weights = ray_weights(sinogram)
    disc = torch.from_numpy(disc_mask(lesion.center[:2], lesion.radius, projector.grid))
    added = projector((lesion.contrast_hu / 1000 * disc).to(sinogram.line_integrals))
    return Sinogram(sinogram.line_integrals + added, DiagonalWeights(weights * torch.exp(-added)))


def lesion_recovery(
    present: Float[Tensor, "rows cols"], absent: Float[Tensor, "rows cols"], lesion: Lesion, grid: ImageGrid
) -> LesionRecovery:
    """Measure a lesion in the difference of two images.

    A nonlinear reconstruction keeps another share of every contrast, size, sign and place: show
    the curve, not a number.

    Args:
        present: Reconstructed from data with the lesion.
        absent: Reconstructed in the same way from the same data without it: the same noise.
        lesion: What is in the data; the slice goes through its middle.
        grid: Where the pixels are.

    Returns:
        How much of it is there, and what else has changed.

    Raises:
        ValueError: If the images are not on the grid or not finite, the lesion is not wholly on the grid or has no
            contrast, or no pixel is farther than 20 mm from it.
    """
    for name, image in (("with", present), ("without", absent)):
        if tuple(image.shape) != grid.shape or not bool(image.isfinite().all()):
            raise ValueError(
                f"The image {name} the lesion must have {grid.shape} finite values, got the shape {tuple(image.shape)}."
            )
    if lesion.contrast_hu == 0:
        raise ValueError("A lesion without contrast cannot be recovered; give it some HU.")
    _check_inside(lesion, grid)
    change = 1000 * (present.detach() - absent.detach()).double().cpu()
    x, y, _ = lesion.center
    away = torch.from_numpy(((grid.x[None, :] - x) ** 2 + (grid.y[:, None] - y) ** 2) ** 0.5)
    distant = away > lesion.radius + DISTANT
    if not bool(distant.any()):
        raise ValueError(
            f"The image must reach farther than {DISTANT:g} mm from the outline of the lesion, but none of its pixels "
            "does."
        )

    def disc(factor: float) -> Tensor:
        return torch.from_numpy(disc_mask((x, y), factor * lesion.radius, grid))

    core, ring = disc(CORE), disc(RING[1]) - disc(RING[0])
    return LesionRecovery(
        lesion,
        recovered=float((core * change).sum() / core.sum()) / lesion.contrast_hu,
        spill=float((ring * change).sum() / ring.sum()) / lesion.contrast_hu,
        distant_hu=math.sqrt(float(change[distant].square().mean())),
    )


def _check_inside(lesion: Lesion, grid: ImageGrid) -> None:
    x, y, _ = lesion.center
    room = min(x - grid.x[0], grid.x[-1] - x, y - grid.y[-1], grid.y[0] - y)
    if room < lesion.radius:
        raise ValueError(
            f"A lesion of radius {lesion.radius:g} mm must lie wholly on the image, but its middle at ({x:g}, {y:g}) "
            f"mm is {max(room, 0.0):.1f} mm from the border or beyond it."
        )
