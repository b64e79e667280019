"""Plug-and-play with total variation on what no training set holds, against FBP with whichever kernel is best.

One strength serves everything. RMSE counts over the whole image and, since the skin line decides there, over the inside
of the body alone.
"""

from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
import torch

from pnpct.denoisers import Gaussian, TotalVariation
from pnpct.evaluation import bias_hu, rmse_hu
from pnpct.geometry import FanBeam, ImageGrid, evenly_spaced_views
from pnpct.operators import Projector
from pnpct.physics import Exposure, take_log
from pnpct.reconstruction import fbp, reconstruct
from pnpct.simulation import Phantom, expose, scanner_beam, truth

STRENGTH = 0.04
GEOMETRY = FanBeam(
    evenly_spaced_views(240), bins=240, source_to_isocenter=541.0, source_to_detector=949.0, bin_width=1.7,
    detector_offset=0.25,
)  # fmt: skip
GRID, FINE = ImageGrid(128, 128, spacing=1.7), ImageGrid(512, 512, spacing=0.425)
X, Y = torch.from_numpy(FINE.x)[None, :], torch.from_numpy(FINE.y)[:, None]
INSIDE = torch.from_numpy(np.hypot(GRID.x[None, :], GRID.y[:, None]) < 82)
ROD = (20.0, -10.0)
FAR = torch.from_numpy(np.hypot(GRID.x[None, :] - ROD[0], GRID.y[:, None] - ROD[1]) > 30)

pytestmark = pytest.mark.slow


def body(*parts: tuple[str, torch.Tensor]) -> Phantom:
    """A disc of water with things of one material in it."""
    materials = ("air", "water", *dict.fromkeys(material for material, _ in parts))
    label = (X**2 + Y**2 < 90**2).long()
    for material, place in parts:
        label = torch.where(place, materials.index(material), label)
    return Phantom(materials, torch.nn.functional.one_hot(label, len(materials)).permute(2, 0, 1).float(), FINE)


def square(x: float, y: float, half: float) -> torch.Tensor:
    return ((X - x).abs() < half) & ((Y - y).abs() < half)


def star(x: float, y: float, radius: float) -> torch.Tensor:
    angle = torch.atan2(Y - y, X - x)
    return torch.hypot(X - x, Y - y) < radius * (0.6 + 0.4 * torch.cos(5 * angle))


def phantom(name: str) -> Phantom:
    if name == "shapes":
        tissues = ("muscle", "adipose", "vertebra", "lung")
        places = (square(-40, 30, 12), star(35, 30, 25), square(30, -40, 8), star(-35, -35, 22))
        return body(*zip(tissues, places, strict=True))
    if name == "wires":
        wires = (torch.remainder(X, 12) < 2) | (torch.remainder(Y, 12) < 2)
        return body(("cortical bone", wires & square(0, 0, 40)))
    if name == "rod":
        return body(("muscle", square(-40, 30, 12)), ("titanium", (X - ROD[0]) ** 2 + (Y - ROD[1]) ** 2 < 5**2))
    return body()


@dataclass(frozen=True)
class Images:
    truth: torch.Tensor
    fbp: tuple[torch.Tensor, ...]
    pnp: torch.Tensor

    def check(self, mask: torch.Tensor) -> None:
        best = min(rmse_hu(image, self.truth, mask=mask) for image in self.fbp)
        assert rmse_hu(self.pnp, self.truth, mask=mask) <= best


@cache
def exposure(name: str, tube_voltage_kvp: float) -> tuple[Exposure, torch.Tensor]:
    beam = scanner_beam(GEOMETRY, tube_voltage_kvp=tube_voltage_kvp)
    if name != "air":
        scanned = phantom(name)
        return expose(scanned, GEOMETRY, beam), truth(scanned, GRID, energy=beam.effective_energy)
    with_body, _ = exposure("water", tube_voltage_kvp)
    moments = with_body.moments
    mean, variance = (air.expand_as(moments.signal_mean).float() for air in (moments.air_mean, moments.air_variance))
    nothing = replace(moments, signal_mean=mean, signal_variance=variance)
    return replace(with_body, moments=nothing), torch.zeros(GRID.shape)


def images(
    name: str, *, tube_current_ma: float = 100.0, tube_voltage_kvp: float = 120.0, strength: float = STRENGTH
) -> Images:
    scanned, expected = exposure(name, tube_voltage_kvp)
    projector = Projector(GRID, GEOMETRY, mu_water=scanned.mu_water)
    scan = scanned.scan(tube_current_ma=tube_current_ma, generator=torch.Generator().manual_seed(1))
    sinogram = take_log(scan)
    kernels = ("ram-lak", "shepp-logan", "hann", "soft")
    by_fbp = tuple(fbp(sinogram.line_integrals, projector, kernel=kernel) for kernel in kernels)
    return Images(expected, by_fbp, reconstruct(sinogram, projector, TotalVariation(strength)))


@pytest.mark.parametrize("name", ["shapes", "wires", "water", "air"])
def test_shapes_wires_and_nothing_are_no_worse_than_by_fbp(name: str) -> None:
    found = images(name)
    found.check(torch.ones_like(INSIDE))
    found.check(INSIDE)


def test_over_the_ladder_of_doses_it_is_no_worse_than_fbp_and_changes_smoothly() -> None:
    ladder = [images("shapes", tube_current_ma=dose) for dose in (20.0, 50.0, 100.0, 300.0, 800.0)]
    for found in ladder:
        found.check(torch.ones_like(INSIDE))
        found.check(INSIDE)
    errors = [rmse_hu(found.pnp, found.truth, mask=INSIDE) for found in ladder]
    # Total variation of one strength does too little for 20 mA, and too much for 800.
    assert all(more <= 1.2 * less for less, more in pairwise(errors))
    biases = [bias_hu(found.pnp, found.truth, mask=INSIDE) for found in ladder]
    assert max(biases) - min(biases) < 1.0


@pytest.mark.parametrize("tube_voltage_kvp", [80.0, 100.0, 140.0])
def test_another_tube_voltage_is_no_worse_than_by_fbp(tube_voltage_kvp: float) -> None:
    found = images("shapes", tube_voltage_kvp=tube_voltage_kvp)
    found.check(torch.ones_like(INSIDE))
    found.check(INSIDE)


def test_a_titanium_rod_disturbs_what_is_far_from_it_less_than_by_fbp() -> None:
    found = images("rod", tube_current_ma=200.0)
    for region in (FAR, FAR & INSIDE):
        found.check(region)
        disturbed = [(image - found.truth).abs()[region].mean() for image in (*found.fbp, found.pnp)]
        assert disturbed[-1] <= min(disturbed[:-1])


def test_in_water_no_blob_is_larger_than_by_fbp() -> None:
    found = images("water", tube_current_ma=20.0)
    for blur in (Gaussian(0.0), Gaussian(1.0)):  # single pixels, and blobs of 4 mm
        largest = [(blur(image) - 1).abs()[INSIDE].max() for image in (*found.fbp, found.pnp)]
        assert largest[-1] <= min(largest[:-1])


def test_a_prior_that_is_too_strong_for_wires_fails_the_suite() -> None:
    found = images("wires", strength=0.3)
    with pytest.raises(AssertionError):
        found.check(INSIDE)
