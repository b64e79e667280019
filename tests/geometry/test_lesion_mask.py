import math

import numpy as np
import pytest

from pnpct.geometry import ImageGrid, Insert, Lesion, disc_mask, lesion_mask

GRID = ImageGrid(48, 48, spacing=0.5)


def test_a_lesion_is_a_sphere() -> None:
    lesion = Lesion((0.0, 0.0, 3.0), radius=5.0, contrast_hu=-40.0)
    for z in (-2.5, -1.0, 3.0, 6.0, 8.5):
        area = lesion_mask([lesion], z, GRID).sum() * GRID.spacing**2
        assert area == pytest.approx(math.pi * max(25.0 - (z - 3.0) ** 2, 0.0), rel=0.03), z


def test_a_pixel_on_the_outline_has_its_share() -> None:
    share = disc_mask((-5.0, 0.0), 5.25, ImageGrid(1, 3, spacing=1.0))
    assert share.tolist() == pytest.approx(np.array([[1.0, 0.75, 0.0]]))


def test_where_lesions_overlap_the_larger_share_counts() -> None:
    lesions = [Lesion((0.0, 0.0, 0.0), 5.0, -60.0), Lesion((3.0, 0.0, 0.0), 4.0, 45.0)]
    masks = [lesion_mask([lesion], 0.0, GRID) for lesion in lesions]
    assert np.array_equal(lesion_mask(lesions, 0.0, GRID), np.maximum(*masks))


@pytest.mark.parametrize(
    "make", [lambda size, hu: Lesion((0, 0, 0), size, hu), lambda size, hu: Insert(size, hu, (0, 0))]
)
def test_a_size_that_is_no_length_and_a_contrast_that_is_no_number_are_refused(make) -> None:
    with pytest.raises(ValueError, match="positive length"):
        make(0.0, 10.0)
    with pytest.raises(ValueError, match="must be finite"):
        make(5.0, math.nan)
