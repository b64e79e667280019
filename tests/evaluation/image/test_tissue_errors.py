import math

import pytest
import torch

from pnpct.evaluation import TISSUES, body_mask, errors_by_tissue, rmse_hu

TRUTH = torch.tensor([-1000.0, -700.0, -300.0, -100.0, 0.0, 60.0, 900.0, 8000.0]).repeat(8, 4) / 1000 + 1
"""Air, lung, an edge, fat, water, muscle, bone and metal."""


def test_each_tissue_has_its_own_bias_and_rmse() -> None:
    shifts = torch.tensor([1.0, -2.0, 100.0, 3.0, -4.0, -4.0, 5.0, 100.0]).repeat(8, 4) / 1000
    found = errors_by_tissue(TRUTH.double() + shifts, TRUTH.double())
    assert list(found) == list(TISSUES)
    for name, shift in (("air", 1), ("lung", -2), ("fat", 3), ("soft tissue", -4), ("bone", 5)):
        assert found[name].bias_hu == pytest.approx(shift)
        assert found[name].rmse_hu == pytest.approx(abs(shift))
        assert found[name].range_hu == TISSUES[name]
        assert found[name].pixels == (64 if name == "soft tissue" else 32)


def test_the_squares_of_all_tissues_add_up_to_those_of_the_image(generator: torch.Generator) -> None:
    image = TRUTH + 0.05 * torch.randn(TRUTH.shape, generator=generator)
    everything = {"low": (-2000.0, -500.0), "middle": (-500.0, 500.0), "high": (500.0, 1e5)}
    found = errors_by_tissue(image, TRUTH, tissues=everything)
    total = sum(error.pixels * error.rmse_hu**2 for error in found.values())
    assert math.sqrt(total / TRUTH.numel()) == pytest.approx(rmse_hu(image, TRUTH), rel=1e-9)


def test_the_upper_end_of_a_range_belongs_to_the_next_tissue() -> None:
    edge = torch.tensor([[1.0, 1.125]], dtype=torch.float64)
    found = errors_by_tissue(edge, edge, tissues={"low": (0.0, 125.0), "high": (125.0, 250.0)})
    assert [error.pixels for error in found.values()] == [1, 1]


def test_only_what_is_in_the_mask_counts_and_absent_tissues_are_left_out(disk: torch.Tensor) -> None:
    image = torch.where(disk == 0, disk + 0.1, disk + 0.02)
    inside = errors_by_tissue(image, disk, mask=body_mask(disk))
    assert list(inside) == ["soft tissue", "bone"]
    assert inside["soft tissue"].rmse_hu == pytest.approx(20.0, abs=1e-3)
    assert errors_by_tissue(image, disk)["air"].bias_hu == pytest.approx(100.0, abs=1e-3)


def test_what_cannot_be_compared_is_refused(disk: torch.Tensor) -> None:
    with pytest.raises(ValueError, match="one shape"):
        errors_by_tissue(disk, disk[1:])
    with pytest.raises(ValueError, match="not finite"):
        errors_by_tissue(disk * math.nan, disk)
