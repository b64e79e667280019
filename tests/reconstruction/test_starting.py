import math
from dataclasses import replace

import torch

from pnpct.geometry import FanBeam, ImageGrid, evenly_spaced_views
from pnpct.operators import Projector
from pnpct.physics import Scan, Sinogram, simulate_counts, take_log
from pnpct.reconstruction import fbp, starting_state
from pnpct.reconstruction.starting import far_apart


def scanned(image: torch.Tensor, A: Projector) -> Sinogram:
    noise = torch.Generator().manual_seed(3)
    counts = simulate_counts(A(image), torch.tensor(2e4), electronic_noise=5.0, generator=noise)
    return take_log(Scan(counts, torch.tensor(2e4), 5.0, geometry=A.geometry, mu_water=A.mu_water))


def test_admm_begins_with_less_noise_than_fbp_has() -> None:
    grid = ImageGrid(96, 96, spacing=3.0)
    geometry = FanBeam(
        evenly_spaced_views(180), 128, source_to_isocenter=541.0, source_to_detector=949.0, bin_width=4.5
    )
    x, y = torch.from_numpy(grid.x), torch.from_numpy(grid.y)[:, None]
    disk, inside = (x**2 + y**2 < 100.0**2).float(), x**2 + y**2 < 85.0**2
    A = Projector(grid, geometry)
    sinogram = scanned(disk, A)
    state = starting_state(sinogram, A)
    smooth = fbp(sinogram.line_integrals, A, kernel="soft")
    error, of_fbp = (float((image - disk)[inside].square().mean().sqrt()) for image in (state.v, smooth))
    assert error < 0.5 * of_fbp
    assert not state.u.any()


def test_where_views_are_far_apart_it_begins_without_their_streaks() -> None:
    grid = ImageGrid(96, 96, spacing=3.0)
    geometry = FanBeam(evenly_spaced_views(40), 128, source_to_isocenter=541.0, source_to_detector=949.0, bin_width=4.5)
    A = Projector(grid, geometry)
    assert far_apart(A)
    golden = tuple(number * math.pi * (3 - 5**0.5) for number in range(100))  # whatever their order
    for angles in (evenly_spaced_views(100), golden):
        assert not far_apart(Projector(grid, replace(geometry, view_angles=angles)))
    x, y = torch.from_numpy(grid.x), torch.from_numpy(grid.y)[:, None]
    inside = x**2 + y**2 < 85.0**2
    body = (x**2 + y**2 < 100.0**2).float() + 0.8 * ((x - 40) ** 2 + y**2 < 15.0**2).float()
    sinogram = scanned(body, A)
    images = starting_state(sinogram, A).v, fbp(sinogram.line_integrals, A, kernel="soft")
    error, of_fbp = (float((image - body)[inside].square().mean().sqrt()) for image in images)
    assert error < 0.6 * of_fbp


def test_bones_are_those_of_fbp(grid: ImageGrid, geometry: FanBeam, disk: torch.Tensor) -> None:
    A = Projector(grid, geometry)
    rows, cols = disk.shape
    bone = torch.zeros_like(disk, dtype=torch.bool)
    bone[rows // 2 - 2 : rows // 2 + 2, cols // 2 - 2 : cols // 2 + 2] = True
    sinogram = scanned(torch.where(bone, 1.8, disk), A)
    start, smooth = starting_state(sinogram, A).v, fbp(sinogram.line_integrals, A, kernel="soft")
    assert torch.equal(start[bone], smooth[bone])
    assert not torch.equal(start[(disk > 0.5) & ~bone], smooth[(disk > 0.5) & ~bone])


def test_with_metal_it_begins_without_its_streaks(grid: ImageGrid, geometry: FanBeam, disk: torch.Tensor) -> None:
    A = Projector(grid, geometry)
    rows, cols = disk.shape
    metal = torch.zeros_like(disk, dtype=torch.bool)
    for first in (-9, 3):
        metal[rows // 2 - 3 : rows // 2 + 3, cols // 2 + first : cols // 2 + first + 6] = True
    sinogram = scanned(torch.where(metal, 30.0, disk), A)
    around = torch.nn.functional.max_pool2d(metal.float()[None], 9, stride=1, padding=4)[0].bool()
    away = (disk > 0.5) & ~around
    streaky = fbp(sinogram.line_integrals, A, kernel="soft")
    error, of_fbp = ((image - disk)[away].square().mean().sqrt() for image in (starting_state(sinogram, A).v, streaky))
    assert error < 0.7 * of_fbp
