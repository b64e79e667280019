"""One small world for all tests."""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from pnpct.geometry import FanBeam, ImageGrid, evenly_spaced_views

if TYPE_CHECKING:  # the process that gives tests to others needs no torch
    import torch


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Real and independently simulated scans, where they are at hand."""
    folder = Path(os.environ.get("PNPCT_TEST_DATA", Path(__file__).parents[2] / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip("the reference scans are not here; set PNPCT_TEST_DATA to their folder")
    return folder


@pytest.fixture
def generator() -> "torch.Generator":
    import torch

    return torch.Generator().manual_seed(20)


@pytest.fixture(scope="session")
def grid() -> ImageGrid:
    return ImageGrid(32, 32, spacing=8.0)


@pytest.fixture(scope="session")
def geometry() -> FanBeam:
    return FanBeam(
        view_angles=evenly_spaced_views(60),
        bins=48,
        source_to_isocenter=541.0,
        source_to_detector=949.0,
        bin_width=12.0,
        detector_offset=0.25,
    )


@pytest.fixture(scope="session")
def disk(grid: ImageGrid) -> "torch.Tensor":
    """Water with a denser insert, air outside."""
    import torch

    x, y = torch.from_numpy(grid.x)[None, :], torch.from_numpy(grid.y)[:, None]
    body = (x**2 + y**2 < 100.0**2).float()
    insert = ((x - 30.0) ** 2 + (y - 20.0) ** 2 < 25.0**2).float()
    return body + 0.2 * insert


@pytest.fixture(scope="session")
def few_validation_examples() -> Iterator[None]:
    """Three, not eight: most of the time of a small training is that of its validation."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("pnpct.training.validation.VALIDATION_EXAMPLES", 3)
        yield


@pytest.fixture(scope="session")
def dataset(tmp_path_factory: pytest.TempPathFactory, few_validation_examples: None) -> Path:
    """A data set of three heads, one slice of each."""
    from pnpct.simulation import Recipe, simulate_dataset

    recipe = Recipe(("head",), cases=3, rows=1, tube_voltages_kvp=(120.0,), views=24, bins=30, size=16)
    folder = tmp_path_factory.mktemp("patients") / "set"
    list(simulate_dataset(folder, recipe))
    return folder
