import pytest
import torch

from pnpct.geometry import ImageGrid
from pnpct.simulation.resampling import area_average

GRID = ImageGrid(6, 9, spacing=1.5, center=(1.0, -2.0))


@pytest.mark.parametrize("parts", [2, 3, 5])
def test_finer_pixels_repeat_the_one_they_lie_in_and_coarser_ones_average_them(parts):
    image = torch.rand(2, 6, 9, generator=torch.Generator().manual_seed(0))
    finer = ImageGrid(6 * parts, 9 * parts, spacing=1.5 / parts, center=GRID.center)
    fine = area_average(image, GRID, finer)
    torch.testing.assert_close(fine, image.repeat_interleave(parts, -1).repeat_interleave(parts, -2))
    torch.testing.assert_close(area_average(fine, finer, GRID), image)


@pytest.mark.parametrize("spacing", [0.7, 1.5, 4.1])
def test_a_grid_that_covers_the_image_keeps_its_integral_and_its_middle(spacing):
    image = torch.rand(6, 9, generator=torch.Generator().manual_seed(1), dtype=torch.float64)
    onto = ImageGrid(40, 40, spacing=spacing)
    averages = area_average(image, GRID, onto)

    def moments(values, grid):
        x, y = torch.from_numpy(grid.x)[None, :], torch.from_numpy(grid.y.copy())[:, None]
        return torch.stack([values.sum(), (values * x).sum(), (values * y).sum()]) * grid.spacing**2

    torch.testing.assert_close(moments(averages, onto)[0], moments(image, GRID)[0])
    if spacing < 1.5:  # within a large pixel the middle is lost
        torch.testing.assert_close(moments(averages, onto), moments(image, GRID), rtol=0.01, atol=0.5)


def test_beyond_the_image_is_nothing():
    far = ImageGrid(4, 4, spacing=1.0, center=(100.0, 0.0))
    assert torch.equal(area_average(torch.ones(6, 9), GRID, far), torch.zeros(4, 4))


def test_an_image_of_another_shape_is_refused():
    with pytest.raises(ValueError, match=r"must end in \(rows, cols\) = \(6, 9\), got \(9, 6\)"):
        area_average(torch.ones(9, 6), GRID, GRID)
