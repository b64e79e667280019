"""The low-contrast phantom: a water disc with faint inserts, in which detectability is measured."""

import math
from collections.abc import Sequence

import numpy as np
import torch

from pnpct.geometry import ImageGrid, Insert, disc_mask
from pnpct.simulation.phantom import Phantom, relative_attenuation

_DENSER = "skin"
"""Of all materials above water the one that behaves most like denser water: 72, 74 and 75 HU at 60, 70 and 80 keV."""

_EDGE = 0.4 * 100 / math.sqrt(2)  # mm: 0.4 of the phantom's radius along a diagonal


CCT189: tuple[Insert, ...] = (
    Insert(diameter=3.0, contrast_hu=14.0, center=(_EDGE, _EDGE)),
    Insert(diameter=5.0, contrast_hu=7.0, center=(-_EDGE, _EDGE)),
    Insert(diameter=7.0, contrast_hu=5.0, center=(-_EDGE, -_EDGE)),
    Insert(diameter=10.0, contrast_hu=3.0, center=(_EDGE, -_EDGE)),
)
"""The inserts of the phantom MITA CCT189: faint ones are large."""


def low_contrast_phantom(
    grid: ImageGrid, *, inserts: Sequence[Insert] = CCT189, radius: float = 100.0, energy: float = 70.0
) -> Phantom:
    """Return a disc of water with inserts, in air; `inserts=()` gives its twin without signal.

    A dark insert is water with air in it. A bright one is water with the share of a denser tissue that gives the
    contrast at the stated energy; from 60 to 80 keV that changes by less than 3 %.

    Args:
        grid: Where the pixels are; finer than the image that will be reconstructed.
        inserts: Any number, in the disc and apart from one another.
        radius: Of the disc, mm, > 0.
        energy: At which the contrasts hold, keV: `Beam.effective_energy` for a scan.

    Returns:
        The phantom, of air, water and, if an insert is bright, a denser tissue.

    Raises:
        ValueError: If the disc reaches out of the grid, an insert out of the disc, two inserts overlap, or a
            contrast cannot be reached.

    References:
        MITA CCT189, The Phantom Laboratory; geometry as in FDA's LCD_CT, doi 10.5281/zenodo.7996580.

    Example:
        >>> from pnpct.simulation import truth
        >>> grid = ImageGrid(105, 105, spacing=2.0)
        >>> image = truth(low_contrast_phantom(grid, inserts=[Insert(20.0, -15.0, (0.0, 0.0))]), grid)
        >>> round(1000 * (image[52, 52].item() - 1), 2), round(image[52, 90].item(), 5)
        (-15.0, 1.0)
    """
    _check_places(grid, inserts, radius)
    dense, water = relative_attenuation((_DENSER, "water"), np.array([float(energy)])).flatten().tolist()
    most = 1000 * (dense / water - 1)
    fractions = torch.zeros(3, *grid.shape, dtype=torch.float64)  # air, water, denser
    fractions[1] = torch.from_numpy(disc_mask((0.0, 0.0), radius, grid))
    for insert in inserts:
        if not -1000 <= insert.contrast_hu <= most:
            raise ValueError(
                f"The contrast of an insert in water can be from -1000 to {most:.0f} HU at {energy:g} keV, got "
                f"{insert.contrast_hu:g}."
            )
        bright = insert.contrast_hu > 0
        full = insert.contrast_hu / most if bright else -insert.contrast_hu / 1000
        share = full * torch.from_numpy(disc_mask(insert.center, insert.diameter / 2, grid))
        fractions[1] -= share
        if bright:
            fractions[2] += share
    fractions[0] = 1 - fractions[1] - fractions[2]
    materials = ("air", "water", _DENSER)
    used = [index for index in range(3) if index < 2 or bool(fractions[index].any())]
    return Phantom(tuple(materials[index] for index in used), fractions[used].clamp(0, 1).float(), grid)


def _check_places(grid: ImageGrid, inserts: Sequence[Insert], radius: float) -> None:
    if not (math.isfinite(radius) and radius > 0):
        raise ValueError(f"The radius of the phantom must be a positive length in mm, got {radius}.")
    half = grid.spacing / 2
    room = min(-grid.x[0], grid.x[-1], -grid.y[-1], grid.y[0]) + half
    if room < radius:
        raise ValueError(f"The grid must hold the phantom of radius {radius:g} mm, but has {room:g} mm on one side.")
    for number, insert in enumerate(inserts):
        if math.hypot(*insert.center) + insert.diameter / 2 > radius:
            raise ValueError(f"Every insert must be inside the phantom of radius {radius:g} mm, got {insert}.")
        for other in inserts[:number]:
            if math.dist(insert.center, other.center) < (insert.diameter + other.diameter) / 2:
                raise ValueError(f"The inserts must not overlap, but {other} and {insert} do.")
