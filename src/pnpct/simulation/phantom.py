"""Objects of known composition, and the image that a perfect scanner would make of them."""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from numpy.typing import NDArray
from torch import Tensor

from pnpct.arrays import Image
from pnpct.geometry import ImageGrid
from pnpct.geometry.short_repr import short_repr
from pnpct.simulation.materials import MATERIALS, attenuation
from pnpct.simulation.resampling import area_average


@dataclass(frozen=True, eq=False)
class Phantom:
    """The fraction of each pixel's volume that each material fills. Beyond the grid is air.

    Args:
        materials: Names in `MATERIALS`, one for each layer of `fractions`.
        fractions: Volume fractions, 0 to 1, that sum to 1 in every pixel.
        grid: Where the pixels are; finer than the images that will be reconstructed, or offset from them.

    Raises:
        ValueError: If a material is unknown, the shapes do not fit, or fractions are negative or do not sum
            to 1.

    Example:
        >>> phantom = Phantom(("air", "water"), torch.full((2, 4, 4), 0.5), ImageGrid(4, 4, spacing=1.0))
        >>> truth(phantom, ImageGrid(2, 2, spacing=2.0))
        tensor([[0.5000, 0.5000],
                [0.5000, 0.5000]])
    """

    materials: tuple[str, ...]
    fractions: Float[Tensor, "materials rows cols"]
    grid: ImageGrid

    __repr__ = short_repr

    def __post_init__(self) -> None:
        for material in self.materials:
            if material not in MATERIALS:
                raise ValueError(f'There is no material "{material}"; there are {", ".join(MATERIALS)}.')
        expected = (len(self.materials), *self.grid.shape)
        if tuple(self.fractions.shape) != expected:
            raise ValueError(
                f"The fractions of {len(self.materials)} materials on this grid have the shape {expected}, "
                f"got {tuple(self.fractions.shape)}."
            )
        if not bool((self.fractions >= 0).all()):
            raise ValueError("Volume fractions must be numbers from 0 to 1; some are negative or not a number.")
        total = self.fractions.sum(dim=0)
        if not bool(((total - 1).abs() < 1e-4).all()):
            raise ValueError(
                "The volume fractions of a pixel must sum to 1, air included; they sum to "
                f"{float(total.min()):.4f} at least and {float(total.max()):.4f} at most."
            )


def relative_attenuation(
    materials: tuple[str, ...], energies: NDArray[np.float64]
) -> Float[Tensor, "materials energies"]:
    """Return μ − μ_air of each material at each energy, 1/mm.

    A scanner measures against air, and what stands in the beam has taken the place of air: so air is 0 here,
    as in the definition of the Hounsfield unit, 1000 (μ − μ_water) / (μ_water − μ_air).

    Args:
        materials: Names in `MATERIALS`.
        energies: Photon energies, keV.

    Raises:
        ValueError: If a material is unknown or an energy is outside the tables.
    """
    air = attenuation("air", energies)
    return torch.from_numpy(np.stack([attenuation(material, energies) - air for material in materials]))


def truth(phantom: Phantom, grid: ImageGrid, *, energy: float = 70.0) -> Image:
    """Return the image of a phantom at one energy: what a reconstruction should be.

    Every pixel is the mean over its area of Σ_m fraction_m (μ_m − μ_air) / (μ_water − μ_air).

    Args:
        phantom: The object.
        grid: Where the pixels of the image are.
        energy: Photon energy, keV.

    Returns:
        Attenuation relative to water, float32.
    """
    *of_materials, of_water = (
        relative_attenuation((*phantom.materials, "water"), np.array([float(energy)])).flatten().tolist()
    )
    relative = torch.tensor(of_materials, dtype=torch.float64, device=phantom.fractions.device) / of_water
    fine = torch.einsum("m,mrc->rc", relative, phantom.fractions.double())
    return area_average(fine, phantom.grid, grid).float()
