"""How far plug-and-play ends from the truth around a network that is being trained."""

from pathlib import Path

import pytest
import torch
from torch import nn

from pnpct.denoisers import RDNCBAM, LearnedDenoiser, RDNSize
from pnpct.evaluation import body_mask, rmse_hu
from pnpct.files import read_exposure, read_manifest
from pnpct.operators import Projector
from pnpct.physics import take_log
from pnpct.reconstruction import PlugAndPlay
from pnpct.training import ClosedLoop, Supervised

SHORT = {"epochs": 1, "pairs_per_epoch": 1, "batch": 1, "examples": 1}


class Sharpening(nn.Module):
    """What looks like a good network on single images, and sharpens its own work in the loop."""

    def forward(self, image: torch.Tensor) -> torch.Tensor:
        blurred = nn.functional.avg_pool2d(image[:, None], 3, 1, 1)[:, 0]
        return image + 0.5 * (image - blurred)


class Unchanging(nn.Module):
    def forward(self, image: torch.Tensor) -> torch.Tensor:
        return image


@pytest.fixture
def files(dataset: Path) -> list[Path]:
    return [dataset / name for name in read_manifest(dataset).files("validation")]


def test_it_is_the_error_of_plug_and_play_on_scans_that_stay_the_same(files: list[Path]) -> None:
    tried = ClosedLoop(files, (50.0, 50.0), seed=2)
    exposed = read_exposure(files[0])
    assert exposed.truth is not None
    assert exposed.grid is not None
    scan = exposed.exposure.scan(tube_current_ma=50.0, generator=torch.Generator().manual_seed(2000))
    A = Projector(exposed.grid, scan.geometry, mu_water=scan.mu_water)
    image = PlugAndPlay(LearnedDenoiser(Unchanging()))(take_log(scan), A).image
    error = rmse_hu(image, exposed.truth, mask=body_mask(exposed.truth))
    found = tried(Unchanging())
    assert len(files) == 1
    assert found["reconstructed_body"] == pytest.approx(error)
    assert "reconstructed_soft" not in found  # so small a head has none
    assert tried(Unchanging()) == found
    assert tried(Sharpening())["reconstructed_body"] > found["reconstructed_body"]


def test_training_says_it_if_it_is_asked_for(dataset: Path) -> None:
    network = RDNCBAM(RDNSize(4, 4, 1, 1))
    plans = [Supervised(**SHORT, reconstructed=number).plan(network, dataset) for number in (0, 1)]
    without, with_it = (plan.validate() for plan in plans)
    assert with_it.keys() - without.keys() == {"reconstructed_body"}
    assert Supervised(reconstructed=1).settings() == Supervised().settings()  # training does not depend on it
    with pytest.raises(ValueError, match="a network without noise level"):
        Supervised(**SHORT, reconstructed=1).plan(RDNCBAM(RDNSize(4, 4, 1, 1), noise_input=True), dataset)
    with pytest.raises(ValueError, match="at least one scan"):
        ClosedLoop([], (20.0, 20.0))
