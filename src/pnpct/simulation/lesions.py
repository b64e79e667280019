"""Lesions of known contrast, size and place, put into any body."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from typing_extensions import override

from pnpct.arrays import Image
from pnpct.geometry import ImageGrid
from pnpct.simulation.anatomy.shapes import Point
from pnpct.simulation.body import Body
from pnpct.simulation.phantom import Phantom, relative_attenuation

_ENERGY = 70.0  # keV, as in `truth`


@dataclass(frozen=True)
class Lesion:
    """A sphere that is brighter or darker than what is there without it.

    Args:
        center: Its middle x, y and z, mm.
        radius: mm, > 0.
        contrast_hu: What it adds at 70 keV, HU; negative for a dark one.

    Raises:
        ValueError: If a number is not finite, or the radius is not positive.

    Example:
        >>> Lesion((10.0, 0.0, 0.0), radius=4.0, contrast_hu=-20.0).radius
        4.0
    """

    center: Point
    radius: float
    contrast_hu: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.radius) and self.radius > 0):
            raise ValueError(f"The radius of a lesion must be a positive length in mm, got {self.radius}.")
        if not all(map(math.isfinite, (*self.center, self.contrast_hu))):
            raise ValueError(f"The centre and the contrast of a lesion must be finite, got {self}.")


def with_lesions(body: Body, lesions: Sequence[Lesion]) -> Body:
    """Put lesions into a body.

    Inside a lesion a share s of all that is there gives way to one material, so that the image at 70 keV changes
    by exactly the contrast in every pixel, and the texture of the body stays:

        s = w · contrast / (HU of the material − HU of what is there)

    with w the share of the pixel inside the sphere (`lesion_mask`). A dark lesion is made with air: the tissue
    is the same, but less dense, and its contrast hardly depends on the energy. A bright one is made with blood
    that has 10 mg/ml of iodine, 317 HU: its contrast follows iodine, as that of an enhancing lesion does, and is
    about twice as large at 50 keV and half as large at 100 keV. Where lesions overlap, contrasts add up.

    Args:
        body: What they are put into: painted, made of CT images or of voxels.
        lesions: Any number.

    Returns:
        A body of the same extent. Its slices raise ValueError where a contrast cannot be reached, because the
        image would fall below air or rise above the blood.

    Raises:
        ValueError: If no slice of the body would show one of the lesions.

    Example:
        >>> from pnpct.simulation import chest_body, truth
        >>> heart, grid = (30.0, 24.0, 0.0), ImageGrid(1, 1, spacing=1.0, center=(30.0, 24.0))
        >>> chest = chest_body(np.random.default_rng(1))
        >>> marked = with_lesions(chest, [Lesion(heart, radius=4.0, contrast_hu=-30.0)])
        >>> change = truth(marked.slice(0.0, grid), grid) - truth(chest.slice(0.0, grid), grid)
        >>> round(1000 * change.item(), 1)
        -30.0
    """
    low, high = body.extent
    for lesion in lesions:
        z = lesion.center[2]
        if z + lesion.radius < low or z - lesion.radius > high:
            raise ValueError(
                f"A lesion of radius {lesion.radius:g} mm at z = {z:g} mm is outside the body, which reaches from "
                f"z = {low:g} to {high:g} mm."
            )
    return _MarkedBody(body, tuple(lesions))


def lesion_mask(lesions: Sequence[Lesion], z: float, grid: ImageGrid) -> Image:
    """Return which share of each pixel is inside a lesion: 1 within, 0 without, and between on the outline.

    The outline is one pixel wide: w = ½ − (distance from the centre − radius) / spacing, from 0 to 1. Where
    lesions overlap it is that of the one to which more of the pixel belongs.

    Args:
        lesions: Any number.
        z: Height of the slice, mm.
        grid: Where the pixels are.
    """
    mask = np.zeros(grid.shape)
    for lesion in lesions:
        x, y, height = lesion.center
        away = np.sqrt((grid.x[None, :] - x) ** 2 + (grid.y[:, None] - y) ** 2 + (z - height) ** 2)
        mask = np.maximum(mask, np.clip(0.5 - (away - lesion.radius) / grid.spacing, 0.0, 1.0))
    return torch.from_numpy(mask).float()


@dataclass(frozen=True, eq=False)
class _MarkedBody(Body):
    """A body with lesions."""

    body: Body
    lesions: tuple[Lesion, ...]

    @property
    @override
    def extent(self) -> tuple[float, float]:
        return self.body.extent

    @override
    def slice(self, z: float, grid: ImageGrid) -> Phantom:
        phantom = self.body.slice(z, grid)
        for lesion in self.lesions:
            phantom = _marked(phantom, lesion, z)
        return phantom


def _marked(phantom: Phantom, lesion: Lesion, z: float) -> Phantom:
    """Replace the share of what is there that changes the image by the contrast."""
    share_inside = lesion_mask([lesion], z, phantom.grid).to(phantom.fractions.device, torch.float64)
    inside = share_inside > 0
    if lesion.contrast_hu == 0 or not bool(inside.any()):
        return phantom
    material = "air" if lesion.contrast_hu < 0 else "iodinated blood"
    materials, fractions = phantom.materials, phantom.fractions
    if material not in materials:
        materials = (*materials, material)
        fractions = torch.cat((fractions, torch.zeros_like(fractions[:1])))
    place = materials.index(material)
    *of_materials, of_water = relative_attenuation((*materials, "water"), np.array([_ENERGY])).flatten().tolist()
    relative = torch.tensor(of_materials, dtype=torch.float64, device=fractions.device) / of_water
    there = fractions[:, inside].double()
    before = relative @ there
    change = share_inside[inside] * (lesion.contrast_hu / 1000)
    after, limit = before + change, relative[place]
    if bool((after < limit).any() if lesion.contrast_hu < 0 else (after > limit).any()):
        worst = before.min() if lesion.contrast_hu < 0 else before.max()
        raise ValueError(
            f"A lesion of {lesion.contrast_hu:+g} HU at {lesion.center} cannot be made at z = {z:g} mm, where there is "
            f"{1000 * (float(worst) - 1):.0f} HU: {material} has {1000 * (float(limit) - 1):.0f} HU; choose another "
            "place or less contrast."
        )
    share = change / (limit - before)
    there = there * (1 - share)
    there[place] += share
    changed = fractions.clone()
    changed[:, inside] = there.to(fractions.dtype)
    return Phantom(materials, changed, phantom.grid)
