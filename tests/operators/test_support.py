"""Outside the support of a projector there is no image: not for rays, nor in the adjoint."""

import pytest
import torch

from pnpct.geometry import ConeBeam, Detector, FanBeam, ImageGrid, Trajectory, VolumeGrid, evenly_spaced_views
from pnpct.operators import ConeProjector, Projector
from pnpct.operators.ray_lines import ray_lines
from pnpct.operators.torch_projector import TorchProjector

DISTANCES = {"source_to_isocenter": 300.0, "source_to_detector": 600.0}
CONE = ConeBeam(
    Trajectory(evenly_spaced_views(40), tuple(0.2 * number - 4 for number in range(40))),
    Detector(bins=50, bin_width=5.0, rows=6, row_height=4.0),
    **DISTANCES,
)


def blob(rows: int, cols: int) -> torch.Tensor:
    """Neither round nor in the middle, and with a hole."""
    y, x = torch.meshgrid(torch.linspace(-1, 1, rows), torch.linspace(-1, 1, cols), indexing="ij")
    return ((x - 0.2).square() + (1.7 * y + 0.5 * x).square() < 0.6) & ((x - 0.3).abs() + y.abs() > 0.2)


def fan(views: int, grid: ImageGrid, support: torch.Tensor | None) -> Projector:
    geometry = FanBeam(evenly_spaced_views(views), bins=50, bin_width=4.0, **DISTANCES)
    return Projector(grid, geometry, support=support)


def cone(views: int, grid: ImageGrid, support: torch.Tensor | None) -> ConeProjector:
    return ConeProjector(VolumeGrid(grid, 5, 2.0), CONE[:views], support=support)


CASES = [
    (fan, 24, ImageGrid(48, 48, 2.0)),  # four turns of one table
    (fan, 24, ImageGrid(40, 64, 1.9)),
    (fan, 23, ImageGrid(70, 48, 1.7, (3.0, -4.0))),  # none
    (cone, 40, ImageGrid(48, 64, 2.0)),
]


@pytest.mark.parametrize(("make", "views", "grid"), CASES)
@pytest.mark.parametrize("slices", [1, 3, 9])
def test_it_is_the_whole_projector_times_a_mask(make, views, grid, slices, generator):
    support = blob(*grid.shape)
    whole, part = make(views, grid, None), make(views, grid, support)
    image = torch.randn(slices, *whole.domain_shape, generator=generator)
    rays = torch.randn(slices, *whole.range_shape, generator=generator).abs()
    assert 0.1 < float(support.double().mean()) < 0.6
    assert torch.equal(part(image), whole(image * support))
    assert torch.equal(part.T(rays), whole.T(rays) * support)
    assert torch.equal(part.gram_diagonal(rays), whole.gram_diagonal(rays) * support)


def test_plain_torch_operations_know_it_too(generator, monkeypatch):
    grid = ImageGrid(40, 64, 1.9)
    compiled, plain = (fan(24, grid, blob(*grid.shape)) for _ in range(2))
    tables = ray_lines(grid, plain.geometry, plain.method)
    kernels = TorchProjector(tables, grid.shape, plain.geometry.views * plain.geometry.bins, torch.device("cpu"))
    monkeypatch.setattr(plain, "_make_kernels", lambda _: kernels)
    image = torch.randn(2, *grid.shape, generator=generator)
    rays = torch.randn(2, *plain.range_shape, generator=generator)
    assert torch.allclose(plain(image), compiled(image), atol=1e-4)
    assert torch.allclose(plain.T(rays), compiled.T(rays), atol=1e-4)


def test_nothing_at_all_is_supported(generator):
    grid = ImageGrid(48, 48, 2.0)
    A = fan(24, grid, torch.zeros(grid.shape, dtype=torch.bool))
    assert float(A(torch.ones(grid.shape)).abs().max()) == 0
    assert float(A.T(torch.ones(A.range_shape)).abs().max()) == 0


@pytest.mark.parametrize("make", [fan, cone])
def test_a_support_of_other_pixels_is_refused(make):
    with pytest.raises(ValueError, match=r"48, 48.*48, 64"):
        make(24, ImageGrid(48, 64, 2.0), blob(48, 48))
