"""Physics that every claim of a lower dose rests on: scans of the low-contrast phantom with doubled diameters."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
import torch

from pnpct.denoisers import Gaussian
from pnpct.evaluation import (
    InsertDetectability,
    InsertScans,
    best_references,
    detectability_by_dose,
    dose_curves,
    dose_reduction,
)
from pnpct.geometry import FanBeam, ImageGrid, evenly_spaced_views
from pnpct.operators import Projector
from pnpct.physics import Sinogram
from pnpct.reconstruction import fbp
from pnpct.simulation import CCT189, expose, low_contrast_phantom, scanner_beam

FULL, DOSES = 200.0, (25.0, 50.0, 100.0, 200.0, 400.0)
INSERTS = tuple(replace(insert, diameter=2 * insert.diameter) for insert in CCT189)
PAIRS = 120

pytestmark = pytest.mark.slow


@dataclass(frozen=True)
class Study:
    scans: InsertScans
    projector: Projector

    @cache  # noqa: B019 - one study lives as long as the module
    def by_blur(self, blur: float) -> list[InsertDetectability]:
        """FBP with a Gaussian of so many pixels after it; all see the same scans."""
        return self.run(Gaussian(blur), DOSES)

    def run(self, after: Callable[[torch.Tensor], torch.Tensor], doses: tuple[float, ...]) -> list[InsertDetectability]:
        def reconstruct(sinogram: Sinogram) -> torch.Tensor:
            return after(fbp(sinogram.line_integrals, self.projector, kernel="hann"))

        generator = torch.Generator().manual_seed(3)
        return list(
            detectability_by_dose(reconstruct, self.scans, tube_currents_ma=doses, pairs=PAIRS, generator=generator)
        )


@pytest.fixture(scope="module")
def study() -> Study:
    geometry = FanBeam(
        evenly_spaced_views(180), bins=200, source_to_isocenter=541.0, source_to_detector=949.0, bin_width=2.0,
        detector_offset=0.25,
    )  # fmt: skip
    beam, fine, grid = scanner_beam(geometry), ImageGrid(420, 420, spacing=0.5), ImageGrid(144, 144, spacing=1.4)
    present, absent = (
        expose(low_contrast_phantom(fine, inserts=inserts, energy=beam.effective_energy), geometry, beam)
        for inserts in (INSERTS, ())
    )
    projector = Projector(grid, geometry, mu_water=present.mu_water)
    return Study(InsertScans(present, absent, INSERTS, grid), projector)


def test_detectability_of_fbp_grows_with_the_root_of_dose(study: Study) -> None:
    for curve in dose_curves(study.by_blur(0.0)).values():
        law = curve.fit()
        assert law.slope == pytest.approx(0.5, abs=0.1)
        assert law.covariance[2] < 0.04**2


@pytest.mark.parametrize("blur", [1.0, 2.0])
def test_a_blur_saves_no_dose(study: Study, blur: float) -> None:
    reference = best_references(dose_curves(study.by_blur(0.0)), full_dose=FULL)
    found = dose_reduction(
        dose_curves(study.by_blur(blur)), reference, full_dose=FULL, generator=np.random.default_rng(1)
    )
    plain, blurred = (
        next(record.noise_hu for record in study.by_blur(each) if record.tube_current_ma == FULL)
        for each in (0.0, blur)
    )
    assert blurred < 0.5 * plain
    for insert in INSERTS:
        task = found.tasks[insert]
        assert task.outside is None
        assert task.fraction.estimate == pytest.approx(1.0, abs=0.15)
        assert task.fraction.low < 1.0 < task.fraction.high
    assert found.least.reduction.low < 0 <= found.least.reduction.high + 0.1


def test_an_observer_that_does_not_prewhiten_is_fooled_by_a_blur(study: Study) -> None:
    plain = {(record.insert, record.tube_current_ma): record for record in study.by_blur(0.0)}
    fooled = [
        record.npwe.d_prime.estimate > plain[record.insert, FULL].npwe.d_prime.estimate
        for record in study.by_blur(2.0)
        if record.tube_current_ma == FULL / 4
    ]
    assert sum(fooled) >= 3, "an eighty per cent noise cut at a quarter of the dose should look like full dose"


# The program LCD_CT is on no package index. What follows is the textbook's observer, written anew with plain
# loops, an explicit polynomial, and one split into halves; it shares nothing with the package but the patches.
def test_the_channelised_hotelling_observer_agrees_with_an_independent_one(study: Study) -> None:
    images: list[torch.Tensor] = []

    def record(image: torch.Tensor) -> torch.Tensor:
        images.append(image)
        return image

    found = study.run(record, (50.0,))
    present, absent = torch.cat(images).double().numpy().reshape(2, PAIRS, *study.scans.grid.shape)
    side, spacing = study.scans.side, study.scans.grid.spacing
    for judged in found:
        row, col = study.scans.corner(judged.insert)
        channels = textbook_channels(side, spacing, judged.insert.diameter)
        v1, v0 = (textbook_outputs(each[:, row : row + side, col : col + side], channels) for each in (present, absent))
        halves = slice(0, PAIRS // 2), slice(PAIRS // 2, PAIRS)
        held_out = [
            textbook_d_prime(v1[train], v0[train], v1[test], v0[test]) for train, test in (halves, halves[::-1])
        ]
        assert judged.hotelling.d_prime.estimate == pytest.approx(np.mean(held_out), rel=0.15)
        assert judged.hotelling.d_prime.estimate == pytest.approx(textbook_d_prime(v1, v0, v1, v0), rel=0.15)


def textbook_channels(side: int, spacing: float, diameter: float) -> list[np.ndarray]:
    """Gallas and Barrett (2003): Laguerre polynomials as Σ (−1)^k C(j, k) x^k / k!, times a Gaussian."""
    width = 2 * diameter / 3
    channels = []
    for order in range(5):
        channel = np.zeros((side, side))
        for i in range(side):
            for j in range(side):
                squared = ((i - side / 2 + 0.5) ** 2 + (j - side / 2 + 0.5) ** 2) * spacing**2
                x = 2 * math.pi * squared / width**2
                laguerre = sum((-1) ** k * math.comb(order, k) * x**k / math.factorial(k) for k in range(order + 1))
                channel[i, j] = math.sqrt(2) / width * math.exp(-math.pi * squared / width**2) * laguerre
        channels.append(channel)
    return channels


def textbook_outputs(patches: np.ndarray, channels: list[np.ndarray]) -> np.ndarray:
    return np.array([[((patch - patch.mean()) * channel).sum() for channel in channels] for patch in patches])


def textbook_d_prime(train1: np.ndarray, train0: np.ndarray, test1: np.ndarray, test0: np.ndarray) -> float:
    covariance = (np.cov(train1.T) + np.cov(train0.T)) / 2
    template = np.linalg.inv(covariance) @ (train1.mean(axis=0) - train0.mean(axis=0))
    t1, t0 = test1 @ template, test0 @ template
    return (t1.mean() - t0.mean()) / math.sqrt((t1.var(ddof=1) + t0.var(ddof=1)) / 2)
