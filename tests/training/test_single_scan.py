import pytest
import torch

from pnpct.training import SplitViewPairs

PARTS = torch.tensor([1.0, 10.0, 100.0, 1000.0]).reshape(4, 1, 1).expand(4, 8, 8)


def test_the_same_number_is_the_same_pair_and_another_number_another() -> None:
    parts = torch.arange(4 * 8 * 8.0).reshape(4, 8, 8)
    first, again, other = (SplitViewPairs(parts, seed=3)(number) for number in (5, 5, 6))
    assert torch.equal(first.input, again.input)
    assert torch.equal(first.target, again.target)
    assert not torch.equal(first.input, other.input)
    assert not torch.equal(first.input, SplitViewPairs(parts, seed=4)(5).input)


def test_the_input_is_the_mean_of_all_parts_but_the_target_and_every_part_is_a_target() -> None:
    drawn = [SplitViewPairs(PARTS, seed=0, augment=False)(number) for number in range(40)]
    assert {pair.target.unique().item() for pair in drawn} == {1.0, 10.0, 100.0, 1000.0}
    for pair in drawn:
        assert pair.input.unique().item() == pytest.approx((1111 - pair.target[0, 0].item()) / 3)


def test_both_images_of_a_pair_are_of_one_slice_and_all_slices_are_drawn() -> None:
    several = torch.stack([PARTS, 1e4 * PARTS], dim=1)
    drawn = [SplitViewPairs(several, seed=0, augment=False)(number) for number in range(40)]
    assert {pair.target.max().item() >= 1e4 for pair in drawn} == {False, True}
    for pair in drawn:
        factor = 1e4 if pair.target.max() >= 1e4 else 1.0
        assert (3 * pair.input + pair.target).max().item() == pytest.approx(1111 * factor)


def test_both_images_are_changed_alike_and_cut_at_one_place() -> None:
    # Parts that are alike show where the square is, and that the change is the same one.
    alike = torch.arange(64.0).reshape(8, 8).expand(3, 8, 8)
    for number in range(10):
        pair = SplitViewPairs(alike, seed=1, side=5)(number)
        assert pair.input.shape == (5, 5)
        torch.testing.assert_close(pair.input, pair.target)


def test_what_cannot_be_learnt_from_is_refused() -> None:
    with pytest.raises(ValueError, match="two or more are needed, got 1"):
        SplitViewPairs(PARTS[:1], seed=0)
    with pytest.raises(ValueError, match="finite"):
        SplitViewPairs(torch.full((2, 8, 8), torch.nan), seed=0)
    with pytest.raises(ValueError, match="patch of 9 pixels"):
        SplitViewPairs(PARTS, seed=0, side=9)(0)
