"""The certainty of a pixel is what its rays weigh, over what rays of weight one weigh on the mean."""

import numpy as np
import pytest
import torch

from pnpct.geometry import ConeBeam, Detector, FanBeam, ImageGrid, Trajectory, VolumeGrid, evenly_spaced_views
from pnpct.operators import ConeProjector, Projector
from pnpct.reconstruction.certainty import COVERED, certainty

FAN = FanBeam(
    evenly_spaced_views(180),
    bins=200,
    source_to_isocenter=541.0,
    source_to_detector=949.0,
    bin_width=1.6,
    detector_offset=0.25,
)


@pytest.mark.parametrize("pixels", [60, 120], ids=["small", "halved"])
def test_where_all_views_see_a_pixel_it_is_their_weight(pixels: int) -> None:
    A = Projector(ImageGrid(pixels, pixels, spacing=100 / pixels), FAN, mu_water=0.0193)
    certain = certainty(torch.full(FAN.shape, 40.0), A)
    torch.testing.assert_close(certain, torch.full_like(certain, 40.0), rtol=0.15, atol=0.0)


@pytest.mark.parametrize("pixels", [60, 120], ids=["small", "halved"])
def test_it_is_the_diagonal_over_that_of_weights_of_one(pixels: int) -> None:
    A = Projector(ImageGrid(pixels, pixels, spacing=100 / pixels), FAN, mu_water=0.0193)
    smooth = 1 + torch.linspace(0, 1, FAN.bins).expand(FAN.shape) + torch.linspace(0, 1, FAN.views)[:, None]
    several = torch.stack([smooth, 3 * smooth])
    certain = certainty(several, A)
    ratio = A.gram_diagonal(several) / A.gram_diagonal(torch.ones(FAN.shape)).mean()
    within = (slice(None), slice(4, -4), slice(4, -4))
    torch.testing.assert_close(certain[within], ratio[within], rtol=0.15, atol=0.0)
    torch.testing.assert_close(certain[1], 3 * certain[0])


def test_it_grows_with_the_number_of_rays_that_count() -> None:
    """Bins beside the middle do not count, so that pixels beyond the middle are met by fewer views."""
    A = Projector(ImageGrid(60, 60, spacing=2.0), FAN, mu_water=0.0193)
    counts = ((torch.arange(FAN.bins) - 100).abs() < 35).float().expand(FAN.shape)
    met = A.gram_diagonal(counts) / A.gram_diagonal(counts).mean()
    well = met > 1.1 * COVERED
    assert float(met[well].max()) > 2 * float(met[well].min())
    torch.testing.assert_close(certainty(40 * counts, A)[well], 40 * met[well])


def test_pixels_that_few_rays_meet_count_as_met_by_more() -> None:
    """Where no ray counts at all, the weight is that of the others."""
    wide = Projector(ImageGrid(120, 120, spacing=6.0), FAN, mu_water=0.0193)
    certain = certainty(torch.full(FAN.shape, 40.0), wide)
    beyond = np.hypot(wide.grid.x, wide.grid.y[:, None]) > 1.3 * FAN.field_of_view_radius
    assert float(certain[torch.from_numpy(beyond)].min()) == pytest.approx(40 * COVERED, rel=0.05)

    turn = 2 * np.pi / 72 * np.arange(72)
    detector = Detector(bins=60, bin_width=14.0, rows=12, row_height=3.0)
    circle = ConeBeam(Trajectory(turn), detector, source_to_isocenter=541.0, source_to_detector=949.0)
    A = ConeProjector(VolumeGrid(ImageGrid(40, 40, spacing=10.0), 60, 1.7), circle, mu_water=0.0193)
    ends = certainty(torch.full(circle.shape, 40.0), A)[[0, -1]]
    torch.testing.assert_close(ends, torch.full_like(ends, 40 * COVERED))
