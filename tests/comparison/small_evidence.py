"""A scan of water with known noise, and a plan of methods that need no network."""

from dataclasses import dataclass
from pathlib import Path

import torch

from pnpct.comparison.candidates import Candidate, blurred, filtered
from pnpct.comparison.honesty import Evidence
from pnpct.comparison.plan import Plan
from pnpct.comparison.results import Method
from pnpct.comparison.stored_images import ImageFolder
from pnpct.geometry import FanBeam, ImageGrid, evenly_spaced_views
from pnpct.operators import Projector
from pnpct.physics import DiagonalWeights, Sinogram

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


def known(name: str, change: torch.Tensor) -> Candidate:
    """FBP with a change that the data know nothing of."""
    fbp = filtered("hann")
    return Candidate(Method(name, name, "denoiser"), lambda data, projector: fbp.make(data, projector) + change)


def fixed(name: str, image: torch.Tensor) -> Candidate:
    """The same image whatever the data."""
    return Candidate(Method(name, name, "denoiser"), lambda data, projector: image)


@dataclass(frozen=True, kw_only=True)
class SmallPlan(Plan):
    """FBP, the control, a method that invents something, and one whose prior removes a part of that."""

    def candidates(self) -> tuple[Candidate, ...]:
        share = 1.0 - self.beta / 2
        return filtered("hann"), blurred(3.0), known("liar", FAKE), known("prior", share * FAKE)


PLAN = SmallPlan(beta=1.0, lesion_hu=-200.0, lesion_diameter=40.0)


def evidence(folder: Path, *, truth: torch.Tensor | None = TRUTH, plan: Plan = PLAN, **of_data: object) -> Evidence:
    data = sinogram(TRUTH if truth is None else truth, **of_data)
    fbp = filtered("hann").make(data, A)
    return Evidence("water", data, A, truth, fbp, plan, ImageFolder(folder, "images/water", GRID, {}))


def images(of: Evidence) -> dict[str, torch.Tensor]:
    return {each.method.name: each.make(of.sinogram, A) for each in of.plan.candidates()}
