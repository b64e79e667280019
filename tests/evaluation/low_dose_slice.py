"""A slice with known truth, its projector, and data with Gaussian noise of known variance."""

from dataclasses import dataclass

import numpy as np
import torch
from scipy.special import j1

from pnpct.geometry import FanBeam, ImageGrid, disc_mask, evenly_spaced_views
from pnpct.operators import Projector
from pnpct.physics import DiagonalWeights, Sinogram


@dataclass(frozen=True, eq=False)
class Slice:
    projector: Projector
    truth: torch.Tensor
    inside: torch.Tensor

    @property
    def grid(self) -> ImageGrid:
        return self.projector.grid

    def sinogram(self, image: torch.Tensor | None = None, *, quanta: float = 1e4, seed: int | None = 1) -> Sinogram:
        """Line integrals of an image (of the truth) with the variance exp(p)/quanta; without noise if seed is None."""
        line_integrals = self.projector(self.truth if image is None else image)
        weights = quanta * torch.exp(-self.projector(self.truth))
        if seed is None:
            return Sinogram(line_integrals, DiagonalWeights(weights))
        noise = torch.randn(weights.shape, generator=torch.Generator().manual_seed(seed))
        return Sinogram(line_integrals + noise / weights.sqrt(), DiagonalWeights(weights))


def low_dose_slice(size: int = 64) -> Slice:
    """An ellipse of water, 260 by 190 mm, with fat, bone, gas and two faint discs, on an image 320 mm wide."""
    grid = ImageGrid(size, size, spacing=320 / size)
    geometry = FanBeam(
        evenly_spaced_views(2 * size - size // 2),
        bins=2 * size - size // 8,
        source_to_isocenter=541.0,
        source_to_detector=949.0,
        bin_width=1.536 * 320 / size,
        detector_offset=0.25,
    )
    x, y = torch.from_numpy(grid.x)[None, :], torch.from_numpy(grid.y)[:, None]

    def ellipse(center: tuple[float, float], half_width: float, half_height: float) -> torch.Tensor:
        return ((((x - center[0]) / half_width) ** 2 + ((y - center[1]) / half_height) ** 2) < 1).float()

    truth = (
        ellipse((0.0, 0.0), 130.0, 95.0)
        + 0.05 * ellipse((-50.0, 20.0), 40.0, 30.0)
        - 0.1 * ellipse((50.0, 30.0), 30.0, 25.0)
        + 0.5 * ellipse((0.0, -60.0), 18.0, 15.0)
        - 0.7 * ellipse((-60.0, -40.0), 25.0, 18.0)
        + 0.04 * ellipse((60.0, -40.0), 8.0, 8.0)
        + 0.06 * ellipse((20.0, 0.0), 6.0, 6.0)
    )
    return Slice(Projector(grid, geometry), truth, ellipse((0.0, 0.0), 118.0, 83.0) > 0)


def disc(center: tuple[float, float], radius: float, grid: ImageGrid) -> torch.Tensor:
    return torch.from_numpy(disc_mask(center, radius, grid)).float()


def disc_spectrum(diameter: float, frequencies: np.ndarray) -> np.ndarray:
    """Fourier transform of a disc of height 1, π R² · 2 J₁(2πRf) / (2πRf), in mm² at frequencies in 1/mm."""
    argument = np.maximum(np.pi * diameter * np.abs(frequencies), 1e-9)
    return np.pi * diameter**2 / 4 * 2 * j1(argument) / argument


def pixel_at(grid: ImageGrid, position: tuple[float, float]) -> tuple[int, int]:
    """Row and column of the pixel nearest to x and y."""
    return int(np.abs(grid.y - position[1]).argmin()), int(np.abs(grid.x - position[0]).argmin())
