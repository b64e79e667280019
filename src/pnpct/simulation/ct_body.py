"""Bodies made of a patient's own CT images."""

from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor
from typing_extensions import override

from pnpct.arrays import Image
from pnpct.denoisers import Denoise
from pnpct.files import ImageSeries
from pnpct.geometry import ImageGrid
from pnpct.simulation.body import Body
from pnpct.simulation.phantom import Phantom, relative_attenuation
from pnpct.simulation.resampling import area_average
from pnpct.units import from_hu

_MATERIALS = ("air", "lung", "adipose", "muscle", "cortical bone")
# Tissues in the order of their HU; whatever is between two neighbours is a mixture of them.
_TISSUES: tuple[dict[str, float], ...] = (
    {"air": 1.0},
    {"lung": 1.0},
    {"lung": 0.3, "muscle": 0.7},  # -192 HU: lung without much air; from here on it gives way to fat
    {"air": 0.025, "adipose": 0.975},  # -100 HU: fat is a little lighter than ICRU's adipose tissue
    {"adipose": 1.0},
    {"muscle": 1.0},
    {"cortical bone": 1.0},
)


@dataclass(frozen=True, eq=False)
class CTBody(Body):
    """The body in a series of CT images.

    Between two images it is interpolated linearly in z. In the plane, pixels are averaged where those that
    are asked for are larger, and interpolated linearly where they are smaller; beyond the images is air.

    HU become volume fractions so that the attenuation at 70 keV is that of the images: -1000 HU is air, -742
    inflated lung, -192 lung with very little air, -100 and -77 fat, 43 muscle, 1561 cortical bone, and what is
    between two of these is a mixture of both. What is above, metal and dense teeth, becomes cortical bone,
    and what is below becomes air. HU alone cannot distinguish contrast medium, blood or stones from bone: whatever is
    above 43 HU attenuates other energies as muscle with some bone does. The table is part of the body.

    The images carry the noise and the streaks of their own scan, which become anatomy here unless `denoise`
    removes them. `NonlocalMeans` with the standard deviation of the noise as its strength is recommended: in
    3 mm slices of a chest with 22 HU of noise in the liver, `NonlocalMeans(0.02)` left 4 HU, and left vessels
    and edges in place, of which `TotalVariation(0.02)` removed more for the same 4 HU. Between two images,
    where both are averaged, there is less noise to begin with.

    Args:
        series: The images; the middle of their pixels becomes (0, 0), wherever the scanner had it.
        denoise: Denoiser of each slice, on the grid of the images, before HU are converted to materials; None
            leaves the noise in.

    Example:
        >>> series = ImageSeries(np.zeros((2, 4, 4), np.int16), ImageGrid(4, 4, 0.8), (0.0, 3.0), "water")
        >>> body = CTBody(series)
        >>> body.extent
        (0.0, 3.0)
        >>> body.slice(1.5, series.plane).fractions[:, 0, 0]
        tensor([0.0000, 0.0000, 0.3600, 0.6400, 0.0000])
    """

    series: ImageSeries
    denoise: Denoise | None = None

    @property
    def materials(self) -> tuple[str, ...]:
        """Names in `MATERIALS` of what the body is made of."""
        return _MATERIALS

    @property
    @override
    def extent(self) -> tuple[float, float]:
        """The heights of the lowest and of the highest image, mm."""
        return self.series.z[0], self.series.z[-1]

    @override
    def slice(self, z: float, grid: ImageGrid) -> Phantom:
        """Return the slice at a height.

        Args:
            z: Height, mm, within `extent`.
            grid: Where the pixels of the slice are; the images have their middle at (0, 0).

        Raises:
            ValueError: If z is outside the extent.
        """
        image = self._image_at(z)
        if self.denoise is not None:
            image = self.denoise(image)
        centred = replace(self.series.plane, center=(0.0, 0.0))
        return Phantom(_MATERIALS, _fractions(_resampled(image, centred, grid)), grid)

    def _image_at(self, z: float) -> Image:
        heights, (low, high) = self.series.z, self.extent
        if not low <= z <= high:
            raise ValueError(f"The images reach from z = {low:.6g} to {high:.6g} mm, but {z:.6g} mm was asked for.")
        above = int(np.searchsorted(heights, z))
        below = above if heights[above] == z else above - 1
        images = [from_hu(torch.from_numpy(self.series.image_hu[at]).float()) for at in (below, above)]
        share = 0.0 if above == below else (z - heights[below]) / (heights[above] - heights[below])
        return torch.lerp(images[0], images[1], share)


def _resampled(image: Image, grid: ImageGrid, onto: ImageGrid) -> Float[Tensor, "new_rows new_cols"]:
    if onto == grid:
        return image
    if onto.spacing >= grid.spacing:
        return area_average(image, grid, onto)
    rows, cols = (
        torch.from_numpy(np.maximum(1 - np.abs(new[:, None] - old) / grid.spacing, 0.0)).to(image)
        for new, old in ((onto.y, grid.y), (onto.x, grid.x))
    )
    return rows @ image @ cols.T


def _fractions(image: Image) -> Float[Tensor, "materials rows cols"]:
    """The volume fractions of the materials that have this attenuation at 70 keV."""
    *of_materials, of_water = relative_attenuation((*_MATERIALS, "water"), np.array([70.0]))[:, 0].tolist()
    mixtures = np.array([[tissue.get(material, 0.0) for material in _MATERIALS] for tissue in _TISSUES])
    knots = mixtures @ np.array(of_materials) / of_water
    values = image.double().cpu().numpy()
    fractions = np.stack([np.interp(values, knots, shares) for shares in mixtures.T])
    return torch.from_numpy(fractions).to(image)
