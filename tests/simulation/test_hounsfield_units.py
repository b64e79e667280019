"""From exposure to image: after the water correction, HU are those of the object at the effective energy."""

import numpy as np
import pytest
import torch

from fixtures.make_catsim_mini import read_catsim_mini
from pnpct.evaluation import soft_tissue_mask
from pnpct.geometry import ImageGrid
from pnpct.operators import Projector
from pnpct.physics import Exposure, take_log
from pnpct.reconstruction import fbp
from pnpct.simulation import Phantom, as_exposure, clinical_fan_beam, expose, scanner_beam, simulate_moments, truth

VOLTAGES = (80.0, 100.0, 120.0)
GRID = ImageGrid(192, 192, spacing=450 / 192)


def reconstructed(exposure: Exposure, grid: ImageGrid) -> torch.Tensor:
    scan = exposure.scan(tube_current_ma=800.0, generator=None)
    projector = Projector(grid, scan.geometry, mu_water=scan.mu_water)
    return fbp(take_log(scan).line_integrals, projector, kernel="ram-lak")


@pytest.mark.parametrize("voltage", VOLTAGES)
def test_water_is_0_hu(voltage: float) -> None:
    fine = ImageGrid(384, 384, spacing=450 / 384)
    inside = torch.from_numpy(np.clip(0.5 + (110 - np.hypot(fine.x, fine.y[:, None])) / fine.spacing, 0, 1)).float()
    fan = clinical_fan_beam(views=240, bins=256)
    water = Phantom(("air", "water"), torch.stack([1 - inside, inside]), fine)
    image = reconstructed(expose(water, fan, scanner_beam(fan, tube_voltage_kvp=voltage)), GRID)
    radius = np.hypot(GRID.x, GRID.y[:, None])
    for ring in (radius < 30, (radius > 40) & (radius < 70), (radius > 75) & (radius < 100)):
        assert abs(1000 * (image[torch.from_numpy(ring)].mean().item() - 1)) < 2


@pytest.mark.parametrize("voltage", VOLTAGES)
@pytest.mark.parametrize("simulator", ["ours", "CatSim's"])
def test_soft_tissue_is_within_4_hu_of_the_phantom(simulator: str, voltage: float) -> None:
    mini = read_catsim_mini()
    beam = scanner_beam(mini.geometry, tube_voltage_kvp=voltage)
    moments = mini.moments[int(voltage)]
    if simulator == "ours":
        (moments,) = simulate_moments(mini.phantom, mini.geometry, [beam])
    image = reconstructed(as_exposure(moments, mini.geometry, beam), GRID)
    known = truth(mini.phantom, GRID, energy=beam.effective_energy)
    tissue = soft_tissue_mask(known, margin=2)
    assert abs(1000 * (image - known)[tissue].mean().item()) < 4


def test_the_noise_of_two_scans_is_independent() -> None:
    fan = clinical_fan_beam(views=492, bins=900)
    phantom = Phantom(("water",), torch.ones(1, 40, 40), ImageGrid(40, 40, spacing=5.0))
    exposure = expose(phantom, fan)
    clean, first, second, again = (
        exposure.scan(tube_current_ma=40.0, generator=None if seed is None else torch.Generator().manual_seed(seed))
        for seed in (None, 1, 2, 1)
    )
    noise = [((scan.counts - clean.counts) / clean.counts.sqrt()).flatten() for scan in (first, second)]
    # 443 thousand rays: the correlation of independent numbers is within 0.0015 of 0.
    assert abs(float(torch.corrcoef(torch.stack(noise))[0, 1])) < 0.005
    assert torch.equal(first.counts, again.counts)
