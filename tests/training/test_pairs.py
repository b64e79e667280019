from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from pnpct.files import ExposedSlice, Provenance, write_exposures
from pnpct.geometry import ImageGrid
from pnpct.physics import Scan
from pnpct.simulation import Phantom, clinical_fan_beam, expose, scanner_beam
from pnpct.training import Examples, Pairs
from pnpct.training.augmentation import Augmentation, change_alike

GRID = ImageGrid(12, 8, spacing=20.0)


@dataclass(frozen=True)
class Pictures:
    """Rays that pass the body, as if they were images, and the noise of the scan.

    Args:
        scales: One for each image.
        random: Whether they are multiplied by a number from 1 to 2 that is drawn.
    """

    scales: tuple[float, ...] = (1.0,)
    random: bool = False

    @property
    def settings(self) -> dict[str, Any]:
        return {"images": "pictures", "scales": list(self.scales), "random": self.random}

    def __call__(self, scan: Scan, grid: ImageGrid, generator: torch.Generator, /) -> torch.Tensor:
        scales = torch.tensor(self.scales)[:, None, None] * (1 + self.random * torch.rand((), generator=generator))
        return scales * scan.counts[:, :8] / scan.incident[:8]


picture, doubled, randomly_scaled = Pictures(), Pictures((2.0,)), Pictures(random=True)


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    fan = clinical_fan_beam(views=12, bins=30)
    phantom = Phantom(("water",), torch.ones(1, 10, 10), ImageGrid(10, 10, spacing=15.0))
    slices = {
        voltage: ExposedSlice(
            expose(phantom, fan, scanner_beam(fan, tube_voltage_kvp=voltage)), torch.ones(12, 8), GRID
        )
        for voltage in (80.0, 120.0)
    }
    path = tmp_path_factory.mktemp("pairs") / "slice.h5"
    write_exposures(path, slices, provenance=Provenance(["test"], "0.1.0"))
    return path


def test_a_number_is_always_the_same_example_and_another_number_another(file: Path) -> None:
    examples = Examples([file], picture, (), seed=3)
    first, again, other = examples(5), Examples([file], picture, (), seed=3)(5), examples(6)
    assert torch.equal(first.low, again.low)
    assert torch.equal(first.references, again.references)
    assert not torch.equal(first.low, other.low)
    assert not torch.equal(first.low, Examples([file], picture, (), seed=4)(5).low)


def test_the_images_of_an_example_show_one_slice_with_independent_noise(file: Path) -> None:
    examples = Examples([file], picture, (), seed=0, tube_currents_ma=(20.0, 20.0))
    low = torch.stack([examples(number).low - 1 for number in range(50)])
    correlation = (low[:, 0] * low[:, 1]).mean() / low.square().mean()
    assert abs(float(correlation)) < 4 / low[:, 0].numel() ** 0.5
    assert low.mean().item() == pytest.approx(0.0, abs=2e-3)


def test_the_high_dose_has_less_noise(file: Path) -> None:
    examples = [Examples([file], picture, (), seed=0)(number) for number in range(10)]
    assert (
        torch.stack([each.references for each in examples]).std()
        < 0.5 * torch.stack([each.low for each in examples]).std()
    )


def test_the_current_of_the_high_dose_changes_its_noise_and_nothing_else(file: Path) -> None:
    usual, higher = (
        [Examples([file], picture, (), seed=0, reference=current)(number) for number in range(10)]
        for current in (800.0, 80000.0)
    )
    noise = [torch.stack([example.references - 1 for example in examples]).std() for examples in (usual, higher)]
    assert float(noise[0] / noise[1]) == pytest.approx(10.0, rel=0.05)
    assert all(torch.equal(one.low, other.low) for one, other in zip(usual, higher, strict=True))


def test_the_truth_as_reference_changes_what_is_learnt_towards_and_nothing_else(file: Path) -> None:
    scanned, true = (
        Examples([file], picture, (doubled,), seed=0, reference=reference)(3) for reference in (800.0, "truth")
    )
    assert torch.equal(true.low, scanned.low)
    assert torch.equal(true.others, scanned.others)
    torch.testing.assert_close(true.references, torch.ones(2, 12, 8))


@dataclass(frozen=True)
class Counts(Pictures):
    """What the rays counted, which the weights of a reconstruction follow."""

    def __call__(self, scan: Scan, grid: ImageGrid, generator: torch.Generator, /) -> torch.Tensor:
        return scan.counts[:, :8]


def test_a_reference_without_noise_is_of_the_dose_of_the_scan_with_it(file: Path) -> None:
    examples = Examples([file], Counts(), (), seed=0, reference="noise-free")
    drawn = [examples(number) for number in range(10)]
    for example in drawn:
        noise = example.low / example.references - 1
        assert float(noise.mean()) == pytest.approx(0.0, abs=0.02)
        assert float(noise.std()) > 1e-4
    assert len({float(example.references.mean()) for example in drawn}) == 10


def test_each_way_to_make_images_can_have_a_reference_of_its_own(file: Path) -> None:
    alike, each = (
        Examples([file], picture, (doubled,), seed=0, make_references=ways)(3) for ways in (None, (picture, doubled))
    )
    assert torch.equal(each.low, alike.low)
    assert torch.equal(alike.references[0], alike.references[1])
    torch.testing.assert_close(each.references, torch.stack([alike.references[0], 2 * alike.references[0]]))


def test_an_image_and_its_reference_are_made_with_the_same_random_settings(file: Path) -> None:
    examples = Examples([file], picture, (randomly_scaled,), seed=0, make_references=(picture, randomly_scaled))
    scales = []
    for number in range(5):
        example = examples(number)
        of_image, of_reference = example.others[0] / example.low[0], example.references[1] / example.references[0]
        torch.testing.assert_close(of_image, of_reference)
        scales.append(float(of_image.mean()))
    assert len(set(scales)) == 5


def test_pairs_are_drawn_from_all_scans_and_ways(file: Path) -> None:
    examples = Examples([file], picture, (doubled,), seed=0, make_references=(picture, doubled))
    low, other, references = vars(examples(0)).values()
    for kind, targets in (("noisy", low), ("dose", references)):
        pairs = Pairs(cache(examples), kind, seed=0, distinct=1, augment=False)
        drawn = [pairs(number) for number in range(40)]
        for image in (*low, *other):
            assert any(torch.equal(pair.input, image) for pair in drawn)
        for target in targets:
            assert any(torch.equal(pair.target, target) for pair in drawn)
        # Never two images of one scan: the noise would be learnt, not removed.
        assert not any(
            torch.equal(pair.target, low[0]) and (torch.equal(pair.input, low[0]) or torch.equal(pair.input, other[0]))
            for pair in drawn
        )
    towards = {int(torch.equal(pair.input, other[0])): pair.target for pair in drawn}  # of the dose pairs
    assert torch.equal(towards[0], references[0])
    assert torch.equal(towards[1], references[1])


def test_half_of_the_inputs_are_fbp_images_however_many_others_there_are(file: Path) -> None:
    several = Pictures((1.5, 1.75, 2.0, 2.25, 2.5))
    examples = Examples([file], picture, (several,), seed=0, make_references=(picture, several))
    low, others, references = vars(examples(0)).values()
    assert (len(others), len(references)) == (5, 6)
    pairs = Pairs(cache(examples), "dose", seed=0, distinct=1, augment=False)
    drawn = [pairs(number) for number in range(400)]
    of_fbp = [pair for pair in drawn if any(torch.equal(pair.input, image) for image in low)]
    assert 160 < len(of_fbp) < 240
    for image, reference in zip(others, references[1:], strict=True):
        towards = [pair.target for pair in drawn if torch.equal(pair.input, image)]
        assert 20 < len(towards) < 60
        assert all(torch.equal(target, reference) for target in towards)


def test_images_of_a_loop_that_diverged_are_left_out(file: Path) -> None:
    ways = picture, Pictures((100.0,)), doubled
    examples = Examples([file], picture, ways[1:], seed=0, make_references=ways)
    _, (_, usual), references = vars(examples(0)).values()
    pairs = Pairs(cache(examples), "dose", seed=0, distinct=1, augment=False)
    drawn = [pairs(number) for number in range(40)]
    assert max(float(pair.input.max()) for pair in drawn) < 10 * float(references[0].max())
    (towards, *_) = [pair.target for pair in drawn if torch.equal(pair.input, usual)]
    assert torch.equal(towards, references[2])


def test_a_pair_with_twice_the_noise_counts_half(file: Path) -> None:
    once = Examples([file], picture, (), seed=0)
    twice = Examples([file], doubled, (), seed=0)
    weights = [Pairs(examples, "noisy", seed=0)(0).weight for examples in (once, twice)]
    assert weights[1] == pytest.approx(weights[0] / 2, rel=1e-4)


@pytest.mark.parametrize(("discount", "factor"), [(0.0, 1.0), (2.0, 0.25)])
def test_how_much_less_can_be_chosen(file: Path, discount: float, factor: float) -> None:
    once, twice = (Examples([file], make, (), seed=0) for make in (picture, doubled))
    weights = [Pairs(examples, "noisy", seed=0, discount=discount)(0).weight for examples in (once, twice)]
    assert weights[1] == pytest.approx(factor * weights[0], rel=1e-4)


def test_images_that_are_not_square_keep_their_shape() -> None:
    for seed in range(20):
        draw = np.random.default_rng(seed)
        changed = change_alike([torch.rand(6, 9), torch.rand(6, 9)], draw, augment=True, side=None)
        assert [each.shape for each in changed] == [(6, 9), (6, 9)]


def test_squares_are_cut_out_of_both_images_at_one_place(file: Path) -> None:
    pair = Pairs(Examples([file], picture, (), seed=0), "noisy", seed=1, augment=False)(3)
    square = Pairs(Examples([file], picture, (), seed=0), "noisy", seed=1, augment=False, side=5)(3)
    places = [
        (row, col)
        for row in range(pair.input.shape[0] - 4)
        for col in range(pair.input.shape[1] - 4)
        if torch.equal(pair.input[row : row + 5, col : col + 5], square.input)
    ]
    ((row, col),) = places
    assert torch.equal(pair.target[row : row + 5, col : col + 5], square.target)


def test_both_images_of_a_pair_are_changed_alike() -> None:
    change = Augmentation.drawn(np.random.default_rng(1))
    image = torch.arange(64.0).reshape(8, 8)
    torch.testing.assert_close(change(2 * image), 2 * change(image))
    assert sorted(change(image).flatten().tolist()) == pytest.approx(sorted((change.scale * image).flatten().tolist()))
    drawn = {Augmentation.drawn(np.random.default_rng(seed)) for seed in range(50)}
    assert len(drawn) == 50


def test_examples_that_cannot_be_drawn_are_refused(file: Path) -> None:
    with pytest.raises(ValueError, match="at least one file"):
        Examples([], picture, (), seed=0)
    with pytest.raises(ValueError, match="Tube currents"):
        Examples([file], picture, (), seed=0, tube_currents_ma=(200.0, 20.0))
    with pytest.raises(ValueError, match="high dose is at least"):
        Examples([file], picture, (), seed=0, reference=100.0)
    with pytest.raises(ValueError, match="truth is not made of a scan"):
        Examples([file], picture, (), seed=0, reference="truth", make_references=(picture,))
    with pytest.raises(ValueError, match="made in 2 ways have as many references, not 1"):
        Examples([file], picture, (doubled,), seed=0, make_references=(picture,))
    with pytest.raises(ValueError, match="patch of 99 pixels"):
        Pairs(Examples([file], picture, (), seed=0), "noisy", seed=0, side=99)(0)
