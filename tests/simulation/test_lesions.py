from dataclasses import dataclass

import numpy as np
import pytest
import torch

from pnpct.files import FractionMap, ImageSeries
from pnpct.geometry import ImageGrid, Lesion, lesion_mask
from pnpct.simulation import Body, CTBody, Phantom, VoxelBody, chest_body, truth, with_lesions
from pnpct.simulation.materials import attenuation
from pnpct.units import to_hu

GRID = ImageGrid(48, 48, spacing=0.5)


@dataclass(frozen=True)
class Block:
    """A body of one material, from −20 to 20 mm, which mentions no other."""

    material: str

    @property
    def extent(self) -> tuple[float, float]:
        return -20.0, 20.0

    def slice(self, z: float, grid: ImageGrid) -> Phantom:
        return Phantom((self.material,), torch.ones(1, *grid.shape), grid)


def inside(lesions: list[Lesion], z: float, grid: ImageGrid = GRID) -> torch.Tensor:
    return torch.from_numpy(lesion_mask(lesions, z, grid)).float()


def change_hu(body: Body, lesions: list[Lesion], z: float = 0.0, grid: ImageGrid = GRID) -> torch.Tensor:
    marked = with_lesions(body, lesions).slice(z, grid)
    return to_hu(truth(marked, grid)) - to_hu(truth(body.slice(z, grid), grid))


@pytest.mark.parametrize("contrast", [-200.0, -40.0, 30.0, 100.0])
def test_the_image_changes_by_the_contrast_inside_and_not_at_all_outside(contrast: float) -> None:
    lesion = Lesion((1.0, -2.0, 0.0), radius=5.0, contrast_hu=contrast)
    mask, change = inside([lesion], 0.0, GRID), change_hu(Block("muscle"), [lesion])
    torch.testing.assert_close(change, contrast * mask, atol=0.1, rtol=0)
    assert torch.all(change[mask == 0] == 0)
    assert (mask == 1).sum() > 250


def test_the_texture_of_the_body_stays_under_a_lesion() -> None:
    chest, heart = chest_body(np.random.default_rng(1)), (30.0, 24.0, 0.0)
    grid = ImageGrid(32, 32, spacing=0.8, center=heart[:2])
    lesion = Lesion(heart, radius=6.0, contrast_hu=-30.0)
    change = change_hu(chest, [lesion], grid=grid)
    lesion_pixels = inside([lesion], 0.0, grid) == 1
    assert to_hu(truth(chest.slice(0.0, grid), grid))[lesion_pixels].std() > 1
    torch.testing.assert_close(change[lesion_pixels], torch.full_like(change[lesion_pixels], -30.0), atol=0.1, rtol=0)


def test_a_lesion_is_a_sphere() -> None:
    lesion = Lesion((0.0, 0.0, 3.0), radius=5.0, contrast_hu=-40.0)
    for z in (-1.0, 6.0):
        expected = lesion.contrast_hu * inside([lesion], z)
        torch.testing.assert_close(change_hu(Block("muscle"), [lesion], z), expected, atol=0.1, rtol=0)
    body, marked = Block("muscle"), with_lesions(Block("muscle"), [lesion])
    assert torch.equal(marked.slice(-3.0, GRID).fractions, body.slice(-3.0, GRID).fractions)


def test_a_pixel_on_the_outline_changes_by_its_share() -> None:
    grid = ImageGrid(1, 3, spacing=1.0)
    lesion = Lesion((-5.0, 0.0, 0.0), radius=5.25, contrast_hu=-80.0)
    assert change_hu(Block("muscle"), [lesion], grid=grid).flatten().tolist() == pytest.approx([-80, -60, 0], abs=0.1)


def test_fractions_still_sum_to_1() -> None:
    lesions = [Lesion((0.0, 0.0, 0.0), 5.0, -60.0), Lesion((3.0, 0.0, 0.0), 4.0, 45.0)]
    phantom = with_lesions(Block("muscle"), lesions).slice(0.0, GRID)
    assert phantom.fractions.min() >= 0
    torch.testing.assert_close(phantom.fractions.sum(0), torch.ones(GRID.shape))


def test_contrasts_add_up_where_lesions_overlap() -> None:
    lesions = [Lesion((0.0, 0.0, 0.0), 5.0, -60.0), Lesion((3.0, 0.0, 0.0), 4.0, 45.0)]
    change = change_hu(Block("muscle"), lesions)
    expected = sum(lesion.contrast_hu * inside([lesion], 0.0, GRID) for lesion in lesions)
    torch.testing.assert_close(change, expected, atol=0.1, rtol=0)


def test_a_dark_lesion_keeps_its_contrast_at_other_energies_and_a_bright_one_follows_iodine() -> None:
    def contrast_at(energy: float, contrast: float) -> float:
        body, grid = Block("muscle"), ImageGrid(1, 1, spacing=1.0)
        marked = with_lesions(body, [Lesion((0.0, 0.0, 0.0), 5.0, contrast)])
        images = [truth(each.slice(0.0, grid), grid, energy=energy) for each in (marked, body)]
        return 1000 * float(images[0] - images[1])

    assert contrast_at(50.0, -100.0) == pytest.approx(-100, rel=0.01)
    of_blood, of_muscle = (
        (attenuation(material, np.array([50.0, 70.0])) / attenuation("water", np.array([50.0, 70.0])))
        for material in ("iodinated blood", "muscle")
    )
    grows = (of_blood - of_muscle)[0] / (of_blood - of_muscle)[1]
    assert grows == pytest.approx(2, abs=0.1)
    assert contrast_at(50.0, 60.0) == pytest.approx(60 * grows, rel=0.01)


def test_lesions_can_be_put_into_ct_images_and_voxels() -> None:
    lesion, grid = Lesion((0.0, 0.0, 1.5), radius=3.0, contrast_hu=50.0), ImageGrid(8, 8, spacing=1.0)
    series = ImageSeries(np.zeros((2, 16, 16), np.int16), ImageGrid(16, 16, 1.0), (0.0, 3.0), "water")
    voxels = VoxelBody((FractionMap("ncat_water", np.ones((2, 16, 16)), ImageGrid(16, 16, 1.0), slice_thickness=5.0),))
    for body in (CTBody(series), voxels):
        marked = with_lesions(body, [lesion])
        assert isinstance(marked, Body)
        assert marked.extent == body.extent
        expected = 50.0 * inside([lesion], 1.5, grid)
        torch.testing.assert_close(change_hu(body, [lesion], 1.5, grid), expected, atol=0.1, rtol=0)


@pytest.mark.parametrize(
    ("material", "contrast", "reason"),
    [
        ("air", -900.0, "air has -1000 HU"),
        ("muscle", -1100.0, "air has"),
        ("muscle", 400.0, "iodinated blood has 317 HU"),
    ],
)
def test_a_contrast_that_cannot_be_reached_is_refused(material: str, contrast: float, reason: str) -> None:
    marked = with_lesions(Block(material), [Lesion((0.0, 0.0, 0.0), 5.0, contrast)])
    with pytest.raises(ValueError, match=reason):
        marked.slice(0.0, GRID)


def test_lesions_outside_the_body_are_refused() -> None:
    with pytest.raises(ValueError, match="outside the body"):
        with_lesions(Block("muscle"), [Lesion((0.0, 0.0, 26.0), 5.0, 10.0)])
