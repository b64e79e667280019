"""Bodies made of voxels."""

from dataclasses import dataclass

import numpy as np
import torch
from typing_extensions import override

from pnpct.files import FractionMap
from pnpct.geometry import ImageGrid
from pnpct.simulation.body import Body
from pnpct.simulation.materials import MATERIALS
from pnpct.simulation.phantom import Phantom
from pnpct.simulation.resampling import area_average

XCIST_MATERIALS = {
    "bone": "cortical bone",
    "ICRU_skeleton_cortical_bone_adult": "cortical bone",
    "ncat_dry_rib": "cortical bone",
    "ncat_dry_spine": "vertebra",
    **{f"ncat_{name}": name for name in ("adipose", "air", "blood", "brain", "cartilage", "heart", "kidney", "liver")},
    **{f"ncat_{name}": name for name in ("lung", "muscle", "pancreas", "skin", "spleen", "water")},
    "ncat_breast_mammary": "breast",
    "ncat_red_marrow": "red marrow",
    "ncat_yellow_marrow": "yellow marrow",
    "ICRU_adipose_adult2": "adipose",
    "ICRU_breast_adult2": "breast",
    "ICRU_lung_adult_healthy": "lung",
    **{f"ICRU_{name}_adult": name for name in ("blood", "brain", "kidney", "liver", "muscle", "pancreas", "skin")},
    "ICRU_spleen_adult": "spleen",
}
"""Which of `MATERIALS` stands for a material of XCIST. The densities of ICRU replace those of NCAT where they
differ: adipose tissue has 0.95 g/cm³ instead of 0.92."""


@dataclass(frozen=True, eq=False)
class VoxelBody(Body):
    """A body of voxels, as XCIST's phantoms are.

    Between the middles of two slices the fractions are interpolated linearly in z; below the middle of the
    lowest slice and above that of the highest they stay as they are there. A body of one slice is the same at
    every z inside it. In the plane voxels are squares of one value, averaged over the pixels that are asked for;
    beyond the voxels, and where materials do not fill a pixel, is air.

    Args:
        maps: Volume fractions of the materials, each on its own part of one lattice; the names are those of
            `MATERIALS` or of XCIST. The maps may name a material more than once.

    Raises:
        ValueError: If there is no map, a material is unknown, or slices differ in thickness.

    Example:
        >>> water = FractionMap("ncat_water", np.ones((2, 4, 4)), ImageGrid(4, 4, spacing=1.0), slice_thickness=5.0)
        >>> body = VoxelBody((water,))
        >>> body.extent, body.materials
        ((-5.0, 5.0), ('air', 'water'))
        >>> body.slice(3.0, ImageGrid(1, 2, spacing=4.0)).fractions.flatten().tolist()
        [0.5, 0.5, 0.5, 0.5]
    """

    maps: tuple[FractionMap, ...]

    def __post_init__(self) -> None:
        if not self.maps:
            raise ValueError("A body needs the volume fractions of at least one material.")
        for of in self.maps:
            _name(of)
        thicknesses = sorted({of.slice_thickness for of in self.maps})
        if thicknesses[-1] > thicknesses[0] * (1 + 1e-6):
            raise ValueError(
                f"All maps of a body need one slice thickness, got {thicknesses[0]} to {thicknesses[-1]} mm."
            )

    @property
    def materials(self) -> tuple[str, ...]:
        """Names in `MATERIALS` of what the body is made of, air first."""
        return ("air", *dict.fromkeys(name for of in self.maps if (name := _name(of)) != "air"))

    @property
    @override
    def extent(self) -> tuple[float, float]:
        """The lowest and the highest z of any voxel, mm."""
        lows, highs = zip(*(of.extent for of in self.maps), strict=True)
        return min(lows), max(highs)

    @override
    def slice(self, z: float, grid: ImageGrid) -> Phantom:
        """Return the slice at a height.

        Args:
            z: Height, mm, within `extent`.
            grid: Where the pixels of the slice are.

        Raises:
            ValueError: If z is outside the extent, or the materials of a pixel there fill more than all of it.
        """
        low, high = self.extent
        if not low <= z <= high:
            raise ValueError(f"The body is known from z = {low:.6g} to {high:.6g} mm, but {z:.6g} mm was asked for.")
        half = self.maps[0].slice_thickness / 2
        level = min(max(z, low + half), high - half)
        fractions = torch.zeros(len(self.materials), *grid.shape)
        for of in self.maps:
            if _name(of) != "air":
                fractions[self.materials.index(_name(of))] += _resampled(of, level, grid)
        total = fractions.sum(dim=0)
        if float(total.max()) > 1.01:
            raise ValueError(
                f"The materials of a pixel at z = {z:.6g} mm fill {float(total.max()):.4g} of its volume; the volume "
                "fractions must sum to 1 at most."
            )
        fractions /= total.clamp(min=1.0)
        fractions[0] = (1 - fractions.sum(dim=0)).clamp(min=0.0)
        return Phantom(self.materials, fractions, grid)


def _name(of: FractionMap) -> str:
    name = XCIST_MATERIALS.get(of.material, of.material)
    if name not in MATERIALS:
        known = ", ".join(sorted({*MATERIALS, *XCIST_MATERIALS}, key=str.lower))
        raise ValueError(f'There is no composition for the material "{of.material}"; known are {known}.')
    return name


def _resampled(of: FractionMap, level: float, grid: ImageGrid) -> torch.Tensor:
    """The fractions at a height; they fall to 0 within one slice beyond the last."""
    slices = len(of.fractions)
    centers = of.center_z + (np.arange(slices) - (slices - 1) / 2) * of.slice_thickness
    shares = np.maximum(0.0, 1 - np.abs(level - centers) / of.slice_thickness)
    between = np.flatnonzero(shares > 1e-9)
    if not len(between):
        return torch.zeros(grid.shape)
    plane = np.tensordot(shares[between], of.fractions[between].astype(np.float32), axes=1)
    return area_average(torch.from_numpy(plane.astype(np.float32)), of.grid, grid)
