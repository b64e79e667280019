from dataclasses import replace

import pytest
import torch

from pnpct.geometry import FanBeam, ImageGrid, evenly_spaced_views
from pnpct.operators import Projector
from pnpct.physics import DiagonalWeights, Sinogram
from pnpct.reconstruction import mean_diagonal
from pnpct.reconstruction.half_resolution import at_half_resolution, doubled, halved

GRID = ImageGrid(95, 96, spacing=3.0, center=(4.0, -2.0))
SCANNER = FanBeam(
    evenly_spaced_views(721),
    129,
    source_to_isocenter=541.0,
    source_to_detector=949.0,
    bin_width=5.0,
    detector_offset=0.25,
)


def blob(grid: ImageGrid) -> torch.Tensor:
    x, y = torch.from_numpy(grid.x), torch.from_numpy(grid.y)[:, None]
    return torch.exp(-((x - 30.0) ** 2 + (y + 20.0) ** 2) / (2 * 25.0**2)).float()


def sinogram_of(image: torch.Tensor, A: Projector) -> Sinogram:
    return Sinogram(A(image), DiagonalWeights(torch.ones(A.range_shape)))


@pytest.mark.parametrize("geometry", [SCANNER, replace(SCANNER, detector="flat"), replace(SCANNER, bins=128)])
def test_pairs_of_rays_are_those_of_the_coarse_pixels(geometry: FanBeam) -> None:
    """Odd numbers of views, cells and rows, an offset and a shifted grid: a misplaced pair would be off by far more."""
    A = Projector(GRID, geometry)
    image = blob(GRID)
    sinogram, coarse = at_half_resolution(sinogram_of(image, A), A)
    assert (coarse.geometry.views, coarse.geometry.bins, coarse.grid.shape) == (361, (geometry.bins + 1) // 2, (48, 48))
    expected = coarse(halved(image))
    torch.testing.assert_close(sinogram.line_integrals, expected, rtol=0, atol=0.012 * float(expected.max()))


def test_a_cell_that_is_not_measured_leaves_its_pair_to_the_other() -> None:
    A = Projector(GRID, SCANNER)
    line_integrals, weights = torch.rand(A.range_shape), 1 + torch.rand(A.range_shape)
    weights[10:12, 40] = 0.0
    weights[20:22, 60:62] = 0.0
    line_integrals[10:12, 40] = 1e6
    half, _ = at_half_resolution(Sinogram(line_integrals, DiagonalWeights(weights)), A)
    pair = weights[10:12, 41]
    assert float(half.line_integrals[5, 20]) == pytest.approx(
        float((line_integrals[10:12, 41] * pair).sum() / pair.sum())
    )
    assert float(half.weights.diagonal.sum()) == pytest.approx(float(weights.sum()))
    assert float(half.weights.diagonal[10, 30]) == 0
    assert bool(half.line_integrals.isfinite().all())


@pytest.mark.parametrize(
    "geometry",
    [
        replace(SCANNER, view_angles=evenly_spaced_views(90)),
        replace(SCANNER, focal_spot_shifts=[(0.5 * (view % 2), 0.0) for view in range(721)]),
    ],
    ids=["far apart", "moving focal spot"],
)
def test_views_that_are_not_alike_are_not_combined(geometry: FanBeam) -> None:
    A = Projector(GRID, geometry)
    half, coarse = at_half_resolution(sinogram_of(blob(GRID), A), A)
    assert coarse.geometry.view_angles == geometry.view_angles
    assert half.line_integrals.shape == (geometry.views, 65)


def test_a_coarse_pixel_has_eight_times_the_certainty() -> None:
    """So that total variation of strength s pixels is that of s/√2 coarse ones."""
    A = Projector(GRID, replace(SCANNER, view_angles=evenly_spaced_views(720)))
    sinogram = sinogram_of((blob(GRID) > 0.4).float(), A)
    assert float(mean_diagonal(*at_half_resolution(sinogram, A)) / mean_diagonal(sinogram, A)) == pytest.approx(
        8, rel=0.1
    )


def test_an_image_comes_back_from_half_its_pixels() -> None:
    ramp = torch.arange(96.0).expand(3, 95, 96) + torch.arange(95.0)[:, None]
    back = doubled(halved(ramp), (95, 96))
    assert back.shape == ramp.shape
    torch.testing.assert_close(back[..., 2:-2, 2:-2], ramp[..., 2:-2, 2:-2])
