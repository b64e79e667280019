from pathlib import Path

import numpy as np
import pytest
import torch

from pnpct.files import ExposedSlice, Provenance, write_exposures
from pnpct.geometry import ImageGrid
from pnpct.physics import Scan
from pnpct.simulation import Phantom, clinical_fan_beam, expose, scanner_beam
from pnpct.training import Pairs
from pnpct.training.augmentation import Augmentation

GRID = ImageGrid(12, 12, spacing=20.0)


def picture(scan: Scan, grid: ImageGrid, generator: torch.Generator) -> torch.Tensor:
    """Rays that pass the body: 1, and the noise of the scan."""
    return scan.counts[:, :8] / scan.incident[:8]


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    fan = clinical_fan_beam(views=12, bins=30)
    phantom = Phantom(("water",), torch.ones(1, 10, 10), ImageGrid(10, 10, spacing=15.0))
    slices = {
        voltage: ExposedSlice(
            expose(phantom, fan, scanner_beam(fan, tube_voltage_kvp=voltage)), torch.ones(12, 12), GRID
        )
        for voltage in (80.0, 120.0)
    }
    path = tmp_path_factory.mktemp("pairs") / "slice.h5"
    write_exposures(path, slices, provenance=Provenance(["test"], "0.1.0"))
    return path


def test_a_number_is_always_the_same_pair_and_another_number_another(file: Path) -> None:
    pairs = Pairs([file], [picture], "noisy", seed=3)
    first, again, other = pairs(5), Pairs([file], [picture], "noisy", seed=3)(5), pairs(6)
    assert torch.equal(first.input, again.input)
    assert torch.equal(first.target, again.target)
    assert not torch.equal(first.input, other.input)
    assert not torch.equal(first.input, Pairs([file], [picture], "noisy", seed=4)(5).input)


def test_noisy_pairs_show_one_slice_with_independent_noise(file: Path) -> None:
    pairs = Pairs([file], [picture], "noisy", seed=0, augment=False, tube_currents_ma=(20.0, 20.0))
    drawn = [pairs(number) for number in range(200)]
    inputs, targets = (torch.stack([getattr(pair, name) for pair in drawn]) for name in ("input", "target"))
    correlation = ((inputs - 1) * (targets - 1)).mean() / (inputs.std() * targets.std())
    assert abs(float(correlation)) < 4 / inputs.numel() ** 0.5
    assert inputs.mean().item() == pytest.approx(1.0, abs=1e-3)


def test_dose_pairs_have_less_noise_in_the_target(file: Path) -> None:
    pairs = Pairs([file], [picture], "dose", seed=0, augment=False)
    drawn = [pairs(number) for number in range(40)]
    rough, smooth = (torch.stack([getattr(pair, name) for pair in drawn]).std() for name in ("input", "target"))
    assert smooth < 0.5 * rough


def test_both_images_of_a_pair_are_changed_alike() -> None:
    change = Augmentation.drawn(np.random.default_rng(1))
    image = torch.arange(64.0).reshape(8, 8)
    torch.testing.assert_close(change(2 * image), 2 * change(image))
    assert sorted(change(image).flatten().tolist()) == pytest.approx(sorted((change.scale * image).flatten().tolist()))
    drawn = {Augmentation.drawn(np.random.default_rng(seed)) for seed in range(50)}
    assert len(drawn) == 50


def test_pairs_that_cannot_be_drawn_are_refused(file: Path) -> None:
    with pytest.raises(ValueError, match="at least one file"):
        Pairs([], [picture], "noisy", seed=0)
    with pytest.raises(ValueError, match="Tube currents"):
        Pairs([file], [picture], "noisy", seed=0, tube_currents_ma=(200.0, 20.0))
