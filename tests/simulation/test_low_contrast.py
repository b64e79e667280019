import math

import numpy as np
import pytest
import torch

from pnpct.comparison.phantoms import INSERTS
from pnpct.geometry import FanBeam, ImageGrid, Insert, evenly_spaced_views
from pnpct.operators import Projector
from pnpct.physics import take_log
from pnpct.reconstruction import fbp
from pnpct.simulation import expose, low_contrast_phantom, scanner_beam, truth
from pnpct.simulation.low_contrast import CCT189

GRID = ImageGrid(420, 420, spacing=0.5)


def hu(inserts: tuple[Insert, ...], energy: float = 70.0) -> torch.Tensor:
    return 1000 * (truth(low_contrast_phantom(GRID, inserts=inserts, energy=energy), GRID, energy=energy).double() - 1)


def from_center(insert: Insert) -> np.ndarray:
    x, y = insert.center
    return np.hypot(GRID.x[None, :] - x, GRID.y[:, None] - y)


@pytest.mark.parametrize("inserts", [CCT189, INSERTS])
@pytest.mark.parametrize("energy", [55.0, 70.0])
def test_each_insert_adds_its_contrast_over_its_area(inserts: tuple[Insert, ...], energy: float) -> None:
    change = (hu(inserts, energy) - hu((), energy)).numpy()
    for insert in inserts:
        near = from_center(insert) < insert.diameter
        assert change[from_center(insert) < 0.4 * insert.diameter] == pytest.approx(insert.contrast_hu, abs=0.01)
        area = change[near].sum() * GRID.spacing**2 / insert.contrast_hu
        assert area == pytest.approx(math.pi * insert.diameter**2 / 4, rel=0.03)
        change[near] = 0.0
    assert np.abs(change).max() < 1e-3


def test_the_inserts_are_on_the_diagonals_at_0_4_of_the_radius() -> None:
    for insert in CCT189:
        assert math.hypot(*insert.center) == pytest.approx(40.0)
        assert abs(insert.center[0]) == pytest.approx(abs(insert.center[1]))
    assert {(insert.diameter, insert.contrast_hu) for insert in CCT189} == {(3, 14), (5, 7), (7, 5), (10, 3)}


def test_without_inserts_it_is_water_in_air() -> None:
    phantom = low_contrast_phantom(GRID, inserts=())
    assert phantom.materials == ("air", "water")
    distance = np.hypot(GRID.x[None, :], GRID.y[:, None])
    image = truth(phantom, GRID).numpy()
    assert image[distance < 99] == pytest.approx(1.0)
    assert image[distance > 101] == pytest.approx(0.0)


def test_a_bright_insert_keeps_its_contrast_at_other_energies() -> None:
    phantom = low_contrast_phantom(GRID, inserts=(Insert(20.0, 50.0, (0.0, 0.0)),))
    for energy in (60.0, 66.0, 80.0):
        contrast = 1000 * (float(truth(phantom, GRID, energy=energy)[210, 210]) - 1)
        assert contrast == pytest.approx(50.0, rel=0.03)


def test_a_scan_shows_the_contrast_at_the_effective_energy() -> None:
    geometry = FanBeam(
        evenly_spaced_views(180), bins=160, source_to_isocenter=541.0, source_to_detector=949.0, bin_width=2.6,
        detector_offset=0.25,
    )  # fmt: skip
    beam, grid = scanner_beam(geometry), ImageGrid(96, 96, spacing=2.2)
    fine = ImageGrid(211, 211, spacing=1.0)
    insert = Insert(30.0, 20.0, (20.0, -10.0))
    images = []
    for inserts in ((insert,), ()):
        phantom = low_contrast_phantom(fine, inserts=inserts, energy=beam.effective_energy)
        exposure = expose(phantom, geometry, beam)
        scan = exposure.scan(tube_current_ma=100.0, generator=None)
        projector = Projector(grid, geometry, mu_water=exposure.mu_water)
        images.append(fbp(take_log(scan, low_counts=0.0).line_integrals, projector, kernel="hann"))
    inside = np.hypot(grid.x[None, :] - 20.0, grid.y[:, None] + 10.0) < 9
    assert 1000 * (images[0] - images[1]).numpy()[inside].mean() == pytest.approx(20.0, rel=0.04)


def test_what_cannot_be_made_is_refused() -> None:
    with pytest.raises(ValueError, match="from -1000 to 74 HU at 70 keV, got 90"):
        low_contrast_phantom(GRID, inserts=[Insert(3.0, 90.0, (0.0, 0.0))])
    with pytest.raises(ValueError, match="inside the phantom"):
        low_contrast_phantom(GRID, inserts=[Insert(3.0, 9.0, (99.0, 0.0))])
    with pytest.raises(ValueError, match="must not overlap"):
        low_contrast_phantom(GRID, inserts=[Insert(3.0, 9.0, (0.0, 0.0)), Insert(5.0, 9.0, (3.0, 0.0))])
    with pytest.raises(ValueError, match="but has 20 mm"):
        low_contrast_phantom(ImageGrid(40, 40, spacing=1.0))
    with pytest.raises(ValueError, match="positive length"):
        low_contrast_phantom(GRID, radius=-1.0)
