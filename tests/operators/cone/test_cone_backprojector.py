from dataclasses import replace

import pytest
import torch
from cone_worlds import CIRCLE, GRID, HELIX, MOVING, WORLDS

from pnpct.geometry import FanBeam, Trajectory, VolumeGrid
from pnpct.operators import ConeBackprojector, FanBackprojector

UP = replace(
    HELIX, trajectory=replace(HELIX.trajectory, focal_spot_shifts=[(0.0, 0.0, 0.7 * (n % 2)) for n in range(34)])
)
SEEN = {name: world for name, world in WORLDS.items() if world[0] is not MOVING} | {"rising focal spot": (UP, GRID)}


@pytest.mark.parametrize("name", SEEN)
def test_compiled_kernels_equal_plain_torch_and_have_an_adjoint(name, generator):
    geometry, grid = SEEN[name]
    B = ConeBackprojector(grid, geometry[::3])
    q = torch.randn(2, *B.domain_shape, generator=generator).requires_grad_()
    y = torch.randn(2, *B.range_shape, generator=generator).requires_grad_()
    volume = B(q)
    expected = torch.stack([B._anywhere(rays) for rays in q.detach()])
    torch.testing.assert_close(volume, expected, rtol=1e-4, atol=1e-4 * float(expected.max()))
    (gradient,) = torch.autograd.grad((volume * y).sum(), q, create_graph=True)
    torch.testing.assert_close(gradient, B.T(y))
    inner, scale = (volume * y).sum().item(), (volume.norm() * y.norm()).item()
    assert abs((gradient * q).sum().item() - inner) < 1e-5 * scale
    (again,) = torch.autograd.grad((gradient * q.detach()).sum(), y)
    assert torch.equal(again, volume)


def test_a_slice_in_the_plane_of_the_circle_is_that_of_the_fan(generator):
    geometry = replace(CIRCLE, detector=replace(CIRCLE.detector, rows=1))
    rays = torch.rand(geometry.shape, generator=generator)
    volume = ConeBackprojector(GRID, geometry)(rays)
    image = FanBackprojector(GRID.plane, FanBeam.from_cone_beam(geometry))(rays[:, 0])
    torch.testing.assert_close(volume, image.expand(GRID.shape), rtol=1e-4, atol=1e-5 * float(image.max()))


def test_the_result_does_not_depend_on_threads_nor_much_on_how_many_views_are_together(generator, monkeypatch):
    B = ConeBackprojector(VolumeGrid(GRID.plane, 13, 4.0), CIRCLE)
    rays = torch.rand(2, *CIRCLE.shape, generator=generator)
    threads = torch.get_num_threads()
    try:
        torch.set_num_threads(1)
        first = B(rays)
        torch.set_num_threads(2)
        assert torch.equal(first, B(rays))
    finally:
        torch.set_num_threads(threads)
    assert torch.equal(first[1], B(rays[1]))
    monkeypatch.setattr("pnpct.operators.cone.cone_backprojector.TOGETHER", 3000)
    torch.testing.assert_close(B(rays), first)


def test_beams_that_cannot_be_back_projected_are_refused():
    with pytest.raises(ValueError, match="takes a focal spot that stays in place"):
        ConeBackprojector(GRID, MOVING)
    with pytest.raises(ValueError, match="No ray meets the volume"):
        ConeBackprojector(replace(GRID, z=400.0), CIRCLE)
    wide = replace(CIRCLE, trajectory=Trajectory((0.0,)), detector=replace(CIRCLE.detector, bins=120))
    with pytest.raises(ValueError, match="at most 45 degrees on a side"):
        ConeBackprojector(GRID, wide)
