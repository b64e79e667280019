"""Training on images of one's own patients: what is a pair, who is held out, what is refused."""

from pathlib import Path

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from pnpct.denoisers import RDNCBAM, RDNSize
from pnpct.files import ImageSeries, read_series, write_image
from pnpct.geometry import ImageGrid, VolumeGrid
from pnpct.training import ImagePairs, NeighbouringSlices, SlicePairs
from pnpct.units import from_hu

PLANE = ImageGrid(8, 8, 1.0)
TINY = RDNSize(features=4, growth=4, blocks=1, convolutions=2)
SHORT = {"epochs": 1, "pairs_per_epoch": 2, "batch": 2}


def series(image_hu: NDArray[np.float32], *, apart: float = 1.0, thickness: float | None = None) -> ImageSeries:
    z = tuple((np.arange(len(image_hu)) * apart).tolist())
    return ImageSeries(image_hu, PLANE, z, "made for a test", thickness)


def slices(number: int, start: float = 0.0) -> NDArray[np.float32]:
    """Slices of one value each: 0 HU, 10 HU and so on from the start."""
    return (np.arange(number, dtype=np.float32)[:, None, None] * 10 + start) * np.ones((1, 8, 8), np.float32)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Five patients with four slices each in two doses, written in three ways."""
    for patient in range(5):
        (tmp_path / f"P{patient}").mkdir()
        for name, shift in (("low", 0.0), ("high", 1.0)):
            image_hu = slices(4, start=100.0 * patient + shift)
            place = tmp_path / f"P{patient}" / name
            if patient == 1:
                z, spacing = np.arange(4.0), np.array(1.0)
                np.savez(f"{place}.npz", hu=image_hu, z_mm=z, spacing_mm=spacing)
            else:
                suffix = ".nii.gz" if patient == 2 else ".h5"
                write_image(f"{place}{suffix}", from_hu(torch.from_numpy(image_hu)), VolumeGrid(PLANE, 4, 1.0, 1.5))
    return tmp_path


def network() -> RDNCBAM:
    torch.manual_seed(0)
    return RDNCBAM(TINY)


def test_every_slice_of_every_patient_is_paired_with_the_same_slice_at_the_other_dose() -> None:
    low, high = [series(slices(3)), series(slices(5, 100.0))], [series(slices(3, 1.0)), series(slices(5, 101.0))]
    pairs = SlicePairs(low, high, seed=0, augment=False)
    drawn = [pairs(number) for number in range(80)]
    assert len(pairs) == len({pair.input[0, 0].item() for pair in drawn}) == 8
    for pair in drawn:
        assert (pair.target - pair.input).mean().item() == pytest.approx(1e-3, abs=1e-6)


def test_the_mean_of_two_neighbours_is_unbiased_where_anatomy_changes_evenly_and_has_noise_of_its_own() -> None:
    draw = np.random.default_rng(0)
    noise = draw.normal(0, 20, (200, 8, 8)).astype(np.float32)
    pairs = SlicePairs([series(slices(200) + noise)], None, seed=0)
    assert len(pairs) == 198
    difference = torch.stack([target - noisy for noisy, target in map(pairs.slices, range(198))])
    assert difference.mean().item() == pytest.approx(0, abs=5e-4)
    # 20 HU of the slice and 20 / √2 HU of the mean of two, which have nothing to do with each other.
    assert difference.std().item() == pytest.approx(0.020 * 1.5**0.5, rel=0.02)


def test_what_is_in_one_slice_alone_is_not_in_the_target() -> None:
    image_hu = slices(3) * 0
    image_hu[1, 4, 4] = 500
    noisy, target = SlicePairs([series(image_hu)], None, seed=0).slices(0)
    assert (noisy[4, 4].item(), target[4, 4].item()) == pytest.approx((1.5, 1.0))


def test_the_same_number_is_the_same_pair_and_a_patch_is_cut_from_both_alike() -> None:
    ramp = np.arange(3 * 64, dtype=np.float32).reshape(3, 8, 8)
    pairs = SlicePairs([series(ramp)], [series(ramp)], seed=3, side=5)
    assert torch.equal(pairs(4).input, pairs(4).input)
    assert not torch.equal(pairs(4).input, pairs(5).input)
    for number in range(5):
        assert torch.equal(pairs(number).input, pairs(number).target)
        assert pairs(number).input.shape == (5, 5)


@pytest.mark.parametrize("name", ["P0", "P1", "P2"])
def test_images_are_the_same_hu_from_every_kind_of_file(folder: Path, name: str) -> None:
    found = read_series(next((folder / name).glob("low.*")))
    np.testing.assert_allclose(found.image_hu, slices(4, start=100.0 * int(name[1])), atol=1e-3)
    assert found.z[1] - found.z[0] == pytest.approx(1.0)


def test_a_fifth_of_the_patients_is_held_out_whole_and_depends_on_the_seed_alone(folder: Path) -> None:
    splits = [ImagePairs(seed=seed).patients(folder) for seed in range(12)]
    assert all((len(split["train"]), len(split["validation"])) == (4, 1) for split in splits)
    assert all(not {*split["train"]} & {*split["validation"]} for split in splits)
    assert len({split["validation"][0] for split in splits}) > 1
    assert splits[3] == ImagePairs(seed=3).patients(folder) == NeighbouringSlices(seed=3).patients(folder)
    named = ImagePairs(validation=("P3", "P1")).patients(folder)
    assert [path.name for path in named["validation"]] == ["P1", "P3"]


@pytest.mark.parametrize(("method", "stage"), [(ImagePairs, "supervised"), (NeighbouringSlices, "noise-to-noise")])
def test_a_plan_trains_on_some_and_validates_on_others(folder: Path, method: type[NeighbouringSlices], stage) -> None:
    D = network()
    plan = method(validation=("P4",), **SHORT).plan(D, folder)
    # A new network changes nothing: 1 HU between the doses, nothing between a slice and its neighbours' mean.
    expected = 1.0 if method is ImagePairs else 0.0
    assert plan.validate()["images"] == pytest.approx(expected, abs=0.01)
    before = {name: weight.clone() for name, weight in D.state_dict().items()}
    (epoch,) = plan.epochs()
    assert (epoch.stage, epoch.number, plan.total) == (stage, 1, 1)
    assert any(not torch.equal(before[name], weight) for name, weight in D.state_dict().items())


def test_the_fingerprints_tell_patients_and_doses_apart(folder: Path) -> None:
    method = ImagePairs(validation=("P4",))
    prints = method.fingerprints(folder)
    assert (len(prints["train"]), len(prints["validation"])) == (4, 1)
    assert NeighbouringSlices(validation=("P4",)).fingerprints(folder)["validation"][0] in prints["validation"][0]
    write_image(folder / "P4" / "high.h5", from_hu(torch.from_numpy(slices(4))), VolumeGrid(PLANE, 4, 1.0, 1.5))
    assert method.fingerprints(folder)["train"] == prints["train"]
    assert method.fingerprints(folder)["validation"] != prints["validation"]


def test_slices_that_overlap_are_refused_as_neighbours_and_taken_as_pairs(folder: Path, monkeypatch) -> None:
    thick = series(slices(4), thickness=1.5)
    monkeypatch.setattr("pnpct.training.own_images.read_series", lambda path: thick)
    with pytest.raises(ValueError, match=r"P\d: slices of 1.5 mm that are 1 mm apart overlap"):
        NeighbouringSlices(**SHORT).plan(network(), folder)
    ImagePairs(**SHORT).plan(network(), folder)


def test_what_cannot_be_learnt_from_is_refused(folder: Path) -> None:
    with pytest.raises(ValueError, match="no patient L333 to validate on"):
        ImagePairs(validation=("L333",)).patients(folder)
    with pytest.raises(ValueError, match="All 5 patients are to validate on"):
        ImagePairs(validation=("P0", "P1", "P2", "P3", "P4")).patients(folder)
    with pytest.raises(ValueError, match=r"P0 must hold full_1mm, .* but holds it 0 times"):
        ImagePairs(high="full_1mm").fingerprints(folder)
    with pytest.raises(ValueError, match="noise-conditioned network cannot learn from images alone"):
        ImagePairs(**SHORT).plan(RDNCBAM(TINY, noise_input=True), folder)
    with pytest.raises(ValueError, match="three slices or more, got 2"):
        SlicePairs([series(slices(2))], None, seed=0)
    with pytest.raises(ValueError, match="at least one patient"):
        SlicePairs([], None, seed=0)
    moved = from_hu(torch.from_numpy(slices(4)))
    write_image(folder / "P0" / "high.h5", moved, VolumeGrid(PLANE, 4, 1.0, 2.5))
    with pytest.raises(ValueError, match="P0: the images of a pair are not in the same place"):
        ImagePairs(**SHORT).plan(network(), folder)
    write_image(folder / "P0" / "high.h5", moved[:3], VolumeGrid(PLANE, 3, 1.0, 1.0))
    with pytest.raises(ValueError, match="P0: pairs have slices and pixels alike"):
        ImagePairs(**SHORT).plan(network(), folder)
    (folder / "P0" / "high.h5").replace(folder / "P0" / "high.nii")
    (folder / "P0" / "high").mkdir()
    with pytest.raises(ValueError, match="holds it 2 times"):
        ImagePairs().fingerprints(folder)


def test_images_that_two_patients_share_are_refused(folder: Path) -> None:
    for name in ("low", "high"):
        (folder / "P0" / f"{name}.h5").write_bytes((folder / "P3" / f"{name}.h5").read_bytes())
    with pytest.raises(ValueError, match="the same images twice"):
        ImagePairs().fingerprints(folder)
