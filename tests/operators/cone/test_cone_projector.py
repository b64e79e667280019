from dataclasses import replace

import pytest
import torch
from cone_worlds import CIRCLE, DETECTOR, GRID, HELIX, PLANE, WORLDS

from pnpct.geometry import ConeBeam, VolumeGrid
from pnpct.operators import ConeProjector
from pnpct.operators.cone.cone_lines import cone_lines
from pnpct.operators.cone.torch_cone_projector import TorchConeProjector


@pytest.fixture(params=WORLDS)
def world(request) -> tuple[ConeBeam, VolumeGrid]:
    return WORLDS[request.param]


def inner(a: torch.Tensor, b: torch.Tensor) -> float:
    return float((a.double() * b.double()).sum())


def test_the_adjoint_has_the_weights_of_the_projector(world, generator):
    geometry, grid = world
    A = ConeProjector(grid, geometry)
    x = torch.randn(grid.shape, generator=generator)
    y = torch.randn(geometry.shape, generator=generator)
    Ax, Aty = A(x), A.T(y)
    assert Ax.shape == y.shape
    assert Aty.shape == x.shape
    assert abs(inner(Ax, y) - inner(x, Aty)) <= 1e-6 * float(Ax.norm() * y.norm())


def test_compiled_kernels_equal_plain_torch(world, generator):
    geometry, grid = world
    geometry = geometry[::5]
    A = ConeProjector(grid, geometry, mu_water=1.0)
    plain = TorchConeProjector(grid, geometry, torch.device("cpu"))
    x = torch.rand(grid.shape, generator=generator)
    y = torch.rand(geometry.shape, generator=generator)
    # float32 sums of hundreds of terms, in another order
    torch.testing.assert_close(A(x), plain.project(x), rtol=1e-4, atol=1e-4 * float(A(x).max()))
    torch.testing.assert_close(A.T(y), plain.back_project(y), rtol=1e-4, atol=1e-4 * float(A.T(y).max()))
    if max(lines.strips.parts for lines in cone_lines(grid, geometry)) > 1:
        return  # cut into parts, whose squares are summed: how many depends on the views beside
    squares = A.gram_diagonal(y)
    torch.testing.assert_close(
        squares, plain.back_project(y, squared=True), rtol=1e-4, atol=1e-4 * float(squares.max())
    )


def test_gradients_are_the_adjoint_and_the_projector(generator):
    A = ConeProjector(GRID, HELIX[::7])
    x = torch.rand(2, *A.domain_shape, generator=generator).requires_grad_()
    y = torch.rand(2, *A.range_shape, generator=generator).requires_grad_()
    (gradient,) = torch.autograd.grad((A(x) * y).sum(), x, create_graph=True)
    torch.testing.assert_close(gradient, A.T(y))
    (again,) = torch.autograd.grad((gradient * x.detach()).sum(), y)  # through the backward pass
    torch.testing.assert_close(again, A(x.detach()))


def test_a_batch_is_its_volumes_in_their_precision(generator):
    A = ConeProjector(GRID, HELIX[::7])
    x = torch.rand(2, 1, *GRID.shape, generator=generator, dtype=torch.float64)
    together = A(x)
    assert together.dtype == torch.float64
    assert together.shape == (2, 1, *A.range_shape)
    assert torch.equal(together[1, 0], A(x[1, 0]))


@pytest.mark.parametrize("kind", ["helix", "cells that share heights", "more parts of a cell than neighbours"])
def test_the_result_does_not_depend_on_threads_or_on_slabs_of_views(kind, generator, monkeypatch):
    geometry, grid = WORLDS[kind]
    x = torch.rand(grid.shape, generator=generator)
    y = torch.rand(geometry.shape, generator=generator)
    A = ConeProjector(grid, geometry)
    threads = torch.get_num_threads()
    try:
        torch.set_num_threads(1)
        first, first_adjoint = A(x), A.T(y)
        torch.set_num_threads(2)
        assert torch.equal(first, A(x))
        assert torch.equal(first_adjoint, A.T(y))
    finally:
        torch.set_num_threads(threads)
    monkeypatch.setattr("pnpct.operators.cone.cpu_cone_projector.SLAB", 2000)
    B = ConeProjector(grid, geometry)
    if kind.startswith("more parts"):  # how many parts depends on the views beside: equal up to rounding
        torch.testing.assert_close(first, B(x), rtol=1e-4, atol=1e-4 * float(first.max()))
    else:
        assert torch.equal(first, B(x))
    torch.testing.assert_close(first_adjoint, B.T(y))


def test_the_gram_diagonal_is_that_of_the_matrix(generator):
    grid = VolumeGrid(replace(PLANE, rows=6, cols=6, spacing=60.0), 5, 9.0)
    A = ConeProjector(grid, HELIX)
    weights = torch.rand(A.range_shape, generator=generator)
    points = torch.eye(180).reshape(-1, *grid.shape)
    expected = (A(points).square() * weights).sum(A.range_dims).reshape(grid.shape)
    torch.testing.assert_close(A.gram_diagonal(weights), expected, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize(
    ("geometry", "grid", "words"),
    [
        (CIRCLE, replace(GRID, z=400.0), "No ray meets the volume: the beam goes from z = -"),
        (CIRCLE, replace(GRID, plane=replace(PLANE, spacing=100.0)), "farthest corner is 1979.9 mm"),
        (replace(CIRCLE, detector=replace(DETECTOR, rows=1, row_height=0.0)), GRID, "height of the detector rows"),
    ],
)
def test_volumes_that_no_cone_beam_can_see_are_refused(geometry, grid, words):
    with pytest.raises(ValueError, match=words):
        ConeProjector(grid, geometry)


def test_options_and_shapes_are_checked():
    with pytest.raises(ValueError, match="attenuation of water must be positive"):
        ConeProjector(GRID, CIRCLE, mu_water=0.0)
    with pytest.raises(ValueError, match=r"end in \(14, 28, 28\), got \(28, 28\)"):
        ConeProjector(GRID, CIRCLE)(torch.zeros(28, 28))
