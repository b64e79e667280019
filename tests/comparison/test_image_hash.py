import pytest
import torch

from pnpct.comparison.image_hash import image_sha256
from pnpct.files import Provenance, read_image, write_image
from pnpct.geometry import ImageGrid

GRID = ImageGrid(8, 6, spacing=0.5, center=(1.0, 2.0))


@pytest.fixture
def image(generator) -> torch.Tensor:
    return torch.rand(8, 6, generator=generator)


def test_one_image_has_one_fingerprint(image):
    assert image_sha256(image, GRID) == image_sha256(image.clone(), ImageGrid(8, 6, 0.5, (1.0, 2.0)))
    assert len(image_sha256(image, GRID)) == 64


def test_one_pixel_changes_it(image):
    changed = image.clone()
    changed[3, 4] += torch.finfo(torch.float32).eps
    assert image_sha256(changed, GRID) != image_sha256(image, GRID)


@pytest.mark.parametrize(
    "grid", [ImageGrid(8, 6, 0.51, (1.0, 2.0)), ImageGrid(8, 6, 0.5, (1.1, 2.0)), ImageGrid(8, 6, 0.5, (2.0, 1.0))]
)
def test_another_grid_changes_it(image, grid):
    assert image_sha256(image, grid) != image_sha256(image, GRID)


def test_the_same_bytes_in_another_shape_are_another_image(image):
    assert image_sha256(image.reshape(6, 8), ImageGrid(6, 8, 0.5, (1.0, 2.0))) != image_sha256(image, GRID)


def test_the_file_does_not_matter(image, tmp_path):
    for name, command in (("a.h5", ["one"]), ("b.h5", ["another", "command"])):
        write_image(tmp_path / name, image, GRID, provenance=Provenance(command, "0.1.0"))
        assert image_sha256(*read_image(tmp_path / name)) == image_sha256(image, GRID)
