"""A scan of water with known noise, and methods that need no network."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from pnpct.comparison import Candidate, Candidates, Study, controls
from pnpct.comparison.data_checks import Evidence
from pnpct.comparison.stored_images import ImageFolder
from pnpct.geometry import FanBeam, ImageGrid, evenly_spaced_views
from pnpct.operators import Projector
from pnpct.physics import DiagonalWeights, Sinogram
from pnpct.reconstruction import FBP, PlugAndPlay, Reconstruction

GRID = ImageGrid(64, 64, spacing=4.0)
FAN = FanBeam(evenly_spaced_views(120), bins=130, source_to_isocenter=541.0, source_to_detector=949.0, bin_width=4.5)
A = Projector(GRID, FAN)


def disc(x: float, y: float, radius: float) -> torch.Tensor:
    """1 inside."""
    across, up = torch.from_numpy(GRID.x)[None, :], torch.from_numpy(GRID.y)[:, None]
    return (((across - x) ** 2 + (up - y) ** 2) < radius**2).float()


TRUTH = disc(0.0, 0.0, 100.0)
FAKE = 0.2 * disc(30.0, 10.0, 8.0)
"""200 HU that are not there."""


def sinogram(truth: torch.Tensor = TRUTH, *, quanta: float = 1e5) -> Sinogram:
    line_integrals = A(truth)
    weights = quanta * torch.exp(-line_integrals)
    noise = torch.randn(weights.shape, generator=torch.Generator().manual_seed(1))
    return Sinogram(line_integrals + noise / weights.sqrt(), DiagonalWeights(weights))


@dataclass(frozen=True, eq=False)
class Fixed:
    """The same image whatever the data."""

    image: torch.Tensor

    @property
    def settings(self) -> dict[str, Any]:
        return {"sum": float(self.image.sum())}

    def __call__(self, data: Sinogram, projector: Projector) -> torch.Tensor:
        return self.image


@dataclass(frozen=True)
class Inventing(PlugAndPlay):
    """FBP and something that the data know nothing of; the prior removes a part of that."""

    def __call__(self, data: Sinogram, projector: Projector, **_: Any) -> Reconstruction:
        image = FBP()(data, projector).image
        return Reconstruction(image + (1 - 0.5 * (PlugAndPlay.sigma_v / self.sigma_v) ** 2) * FAKE, self.settings)


def fixed(name: str, image: torch.Tensor) -> Candidate:
    return Candidate(name, name, "compared", Fixed(image))


def methods(*more: Candidate, blur: float = 3.0) -> Candidates:
    """FBP and the control, and then others."""
    return Candidates((*controls(blur_pixels=blur), *more))


def swept(beta: float = 1.0) -> Candidates:
    """A prior with a multiple of the usual penalty."""
    sigma_v = PlugAndPlay.sigma_v / beta**0.5
    return methods(Candidate("prior", "prior", "swept", Inventing(torch.clone, sigma_v=sigma_v)))


STUDY = Study(lesion_hu=-200.0, lesion_diameter=40.0)


def evidence(
    folder: Path, given: Candidates | None = None, *, truth: torch.Tensor | None = TRUTH, **of_data: object
) -> Evidence:
    given = methods() if given is None else given
    data = sinogram(TRUTH if truth is None else truth, **of_data)
    fbp = given.baseline.make(data, A)
    return Evidence("water", data, A, truth, fbp, given, STUDY, ImageFolder(folder, "images/water", GRID, {}))


def images(of: Evidence) -> dict[str, torch.Tensor]:
    return {each.name: each.make(of.sinogram, A) for each in of.methods}
