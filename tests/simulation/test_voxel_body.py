import importlib.util
from pathlib import Path

import numpy as np
import pytest
import torch
import xraydb

from pnpct.files import FractionMap, read_xcist_phantom
from pnpct.geometry import ImageGrid
from pnpct.simulation import MATERIALS, VoxelBody, attenuation
from pnpct.simulation.voxel_body import XCIST_MATERIALS

GRID = ImageGrid(4, 6, spacing=2.0, center=(1.0, -3.0))


def of_water(fractions, *, thickness=3.0, center_z=0.0, material="water", grid=GRID):
    values = np.asarray(fractions, dtype=np.float32)[:, None, None] * np.ones(grid.shape, dtype=np.float32)
    return FractionMap(material, values, grid, slice_thickness=thickness, center_z=center_z)


def water(body, z):
    return body.slice(z, ImageGrid(1, 1, spacing=2.0, center=(2.0, -2.0))).fractions[1].item()


def test_a_slab_is_the_same_at_every_height_inside_it():
    body = VoxelBody((of_water([0.7], thickness=50.0, center_z=10.0),))
    assert body.extent == (-15.0, 35.0)
    assert [water(body, z) for z in (-15.0, 3.0, 35.0)] == pytest.approx([0.7] * 3)


def test_between_slices_it_is_interpolated_and_at_the_ends_constant():
    body = VoxelBody((of_water([0.0, 0.8, 0.2]),))
    heights = [-4.5, -3.0, -1.5, 0.0, 1.0, 3.0, 4.5]
    assert [water(body, z) for z in heights] == pytest.approx([0.0, 0.0, 0.4, 0.8, 0.6, 0.2, 0.2], abs=1e-6)


def test_what_is_cut_down_to_its_box_is_the_same_body():
    generator = np.random.default_rng(3)
    fractions = np.zeros((5, 8, 9), dtype=np.float32)
    fractions[1:4, 2:5, 3:9] = generator.uniform(0, 0.5, (3, 3, 6))
    other = np.full((5, 8, 9), 0.5, dtype=np.float32)
    grid = ImageGrid(8, 9, spacing=1.0)
    box = ImageGrid(3, 6, spacing=1.0, center=(1.5, 0.5))
    whole = VoxelBody((FractionMap("muscle", fractions, grid, 2.0), FractionMap("water", other, grid, 2.0)))
    cut = VoxelBody(
        (FractionMap("muscle", fractions[1:4, 2:5, 3:9], box, 2.0), FractionMap("water", other, grid, 2.0)),
    )
    onto = ImageGrid(11, 11, spacing=0.9, center=(0.3, 0.1))
    for z in (-4.9, -2.7, 0.1, 3.1, 5.0):
        torch.testing.assert_close(cut.slice(z, onto).fractions, whole.slice(z, onto).fractions, rtol=0, atol=1e-6)


def test_what_the_voxels_do_not_fill_is_air():
    body = VoxelBody((of_water([0.25]), of_water([0.5], material="ncat_lung")))
    phantom = body.slice(0.0, ImageGrid(4, 8, spacing=2.0, center=(1.0, -3.0)))
    assert phantom.materials == body.materials == ("air", "water", "lung")
    inside = torch.tensor([0.25, 0.25, 0.5])
    torch.testing.assert_close(phantom.fractions[:, :, 1:7], inside[:, None, None].expand(3, 4, 6))
    assert torch.equal(phantom.fractions[:, :, [0, 7]], torch.eye(3)[0][:, None, None].expand(3, 4, 2))


def test_maps_of_one_material_are_added():
    body = VoxelBody((of_water([0.25]), of_water([0.5], material="ncat_water"), of_water([0.1], material="air")))
    assert body.materials == ("air", "water")
    assert water(body, 0.0) == pytest.approx(0.75)


def test_a_sum_just_above_1_is_normalised_and_more_is_refused():
    body = VoxelBody((of_water([1.0]), of_water([0.005], material="lung")))
    phantom = body.slice(0.0, GRID)
    torch.testing.assert_close(phantom.fractions[1:, 0, 0], torch.tensor([1.0, 0.005]) / 1.005)
    body = VoxelBody((of_water([1.0]), of_water([0.2], material="lung")))
    with pytest.raises(ValueError, match=r"a pixel at z = 0\.5 mm fill 1\.2 of its volume"):
        body.slice(0.5, GRID)


def test_impossible_bodies_and_heights_are_refused():
    with pytest.raises(ValueError, match='no composition for the material "ncat_butter"; known are adipose, air'):
        VoxelBody((of_water([1.0], material="ncat_butter"),))
    with pytest.raises(ValueError, match="at least one material"):
        VoxelBody(())
    with pytest.raises(ValueError, match=r"one slice thickness, got 2\.0 to 3\.0 mm"):
        VoxelBody((of_water([0.5], thickness=2.0), of_water([0.5])))
    with pytest.raises(ValueError, match=r"from z = -1\.5 to 1\.5 mm, but 1\.6 mm was asked for"):
        VoxelBody((of_water([1.0]),)).slice(1.6, GRID)


def test_the_chest_of_xcist_keeps_its_volumes(shared_data):
    maps = read_xcist_phantom(next((shared_data / "phantoms").glob("*.zip")))
    body = VoxelBody(maps)
    grid = ImageGrid(64, 64, spacing=7.0)
    phantom = body.slice(-20.0, grid)
    expected = {XCIST_MATERIALS[of.material]: float(of.fractions.sum()) * of.grid.spacing**2 for of in maps}
    areas = (phantom.fractions.sum(dim=(1, 2)) * grid.spacing**2).tolist()
    assert dict(zip(phantom.materials[1:], areas[1:], strict=True)) == pytest.approx(expected, rel=1e-4)


def test_materials_attenuate_as_those_of_xcist_with_their_names():
    found = importlib.util.find_spec("gecatsim")
    if found is None:
        pytest.skip("CatSim is not installed")
    energy = np.array([70.0])
    for name, ours in XCIST_MATERIALS.items():
        path = Path(found.submodule_search_locations[0], "material", name)
        lines = [line.split() for line in path.read_text().splitlines() if line[:1].isdigit()]
        density, elements = float(lines[1][0]), [(int(z), float(share)) for z, share, *_ in lines[2:]]
        total = sum(share for _, share in elements)
        theirs = sum(share * xraydb.mu_elam(z, energy * 1000) for z, share in elements) * density / total / 10
        np.testing.assert_allclose(attenuation(ours, energy), theirs, rtol=0.035, err_msg=name)
        assert MATERIALS[ours].density == pytest.approx(density, rel=0.035), name
