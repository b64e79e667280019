"""Put lesions of known contrast, size and place into any body."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from typing_extensions import override

from pnpct.geometry import ImageGrid, Lesion, lesion_mask
from pnpct.simulation.body import Body
from pnpct.simulation.phantom import Phantom, relative_attenuation

_ENERGY = 70.0  # keV, as in `truth`


def with_lesions(body: Body, lesions: Sequence[Lesion]) -> Body:
    """Put lesions into a body.

    Inside a lesion a share s of all that is there gives way to one material, so that the image at 70 keV changes
    by exactly the contrast in every pixel, and the texture of the body stays:

        s = w · contrast / (HU of the material − HU of what is there)

    with w the fraction of the pixel inside the sphere (`lesion_mask`). A dark lesion is made with air: the tissue
    is the same, but less dense, and its contrast barely depends on the energy. A bright one is made with blood
    that has 10 mg/ml of iodine, 317 HU: its contrast follows iodine, as that of an enhancing lesion does, and is
    about twice as large at 50 keV and half as large at 100 keV. Where lesions overlap, contrasts add up.

    Args:
        body: What they are put into: painted, made of CT images or of voxels.
        lesions: Any number.

    Returns:
        A body of the same extent. Its slices raise ValueError where a contrast cannot be reached, because the
        image would fall below air or rise above the blood.

    Raises:
        ValueError: If one of the lesions is in no slice of the body.

    Example:
        >>> from pnpct.simulation import chest_body, truth
        >>> heart, grid = (30.0, 24.0, 0.0), ImageGrid(1, 1, spacing=1.0, center=(30.0, 24.0))
        >>> chest = chest_body(np.random.default_rng(1))
        >>> with_nodule = with_lesions(chest, [Lesion(heart, radius=4.0, contrast_hu=-30.0)])
        >>> change = truth(with_nodule.slice(0.0, grid), grid) - truth(chest.slice(0.0, grid), grid)
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
    return _BodyWithLesions(body, tuple(lesions))


@dataclass(frozen=True, eq=False)
class _BodyWithLesions(Body):
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
            phantom = _with_lesion(phantom, lesion, z)
        return phantom


def _with_lesion(phantom: Phantom, lesion: Lesion, z: float) -> Phantom:
    """Replace the share of what is there that changes the image by the contrast."""
    share_inside = torch.from_numpy(lesion_mask([lesion], z, phantom.grid)).to(phantom.fractions.device)
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
