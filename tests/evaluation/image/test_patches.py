import pytest
import torch

from pnpct.evaluation import Patch, tile_patches
from pnpct.evaluation.image.patches import patch_values


def test_tiles_cover_the_image_but_for_what_is_left() -> None:
    seen = torch.zeros(10, 13)
    for patch in tile_patches((10, 13), size=4):
        seen[patch.row : patch.row + 4, patch.col : patch.col + 4] += 1
    assert torch.equal(seen[:8, :12], torch.ones(8, 12))
    assert seen.sum() == 96


def test_values_are_those_of_the_image_in_hu() -> None:
    image = torch.arange(36.0, dtype=torch.float64).reshape(6, 6)
    (cut,) = patch_values(image, [Patch(2, 3)], 2)
    assert cut.tolist() == [[14000.0, 15000.0], [20000.0, 21000.0]]


def test_a_patch_outside_the_image_is_refused() -> None:
    with pytest.raises(ValueError, match="inside the 6 x 6 image"):
        patch_values(torch.ones(6, 6), [Patch(0, 3)], 4)
    with pytest.raises(ValueError, match="begins inside"):
        Patch(-1, 0)
    with pytest.raises(ValueError, match="must hold a patch"):
        tile_patches((6, 6), size=8)
    with pytest.raises(ValueError, match="no patch"):
        patch_values(torch.ones(6, 6), [], 4)
    with pytest.raises(ValueError, match="not finite"):
        patch_values(torch.full((6, 6), torch.nan), [Patch(0, 0)], 4)
