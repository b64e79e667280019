"""A network learns from what plug-and-play ends with: its gradient, what it is given, and that it works."""

import copy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import nn

from pnpct.denoisers import RDNCBAM, LearnedDenoiser, RDNSize
from pnpct.files import read_exposure, read_manifest
from pnpct.geometry import FanBeam, ImageGrid
from pnpct.operators import Projector
from pnpct.physics import DiagonalWeights, Scan, simulate_counts, take_log
from pnpct.reconstruction import PlugAndPlay, fbp, normal_equations, starting_state
from pnpct.reconstruction.iteration_schedule import MOST
from pnpct.training import ClosedLoop, ThroughLoop, through_loop
from pnpct.training.loop_scans import CONTRASTS_HU, LoopScan, LoopScans, changed, drawn_discs
from pnpct.training.through_loop import THROUGH, denoised_by, reconstructed_around, relative_loss, through_loop_losses


class Blending(nn.Module):
    """Between an image and its means over 3 × 3 pixels: 0 is the image, 1 the means, and less than 0 sharpens."""

    def __init__(self, share: float) -> None:
        super().__init__()
        self.share = nn.Parameter(torch.tensor(share))

    def forward(self, image: torch.Tensor) -> torch.Tensor:
        return torch.lerp(image, nn.functional.avg_pool2d(image[:, None], 3, 1, 1)[:, 0], self.share)


@pytest.fixture(scope="module")
def scan(grid: ImageGrid, geometry: FanBeam, disk: torch.Tensor) -> LoopScan:
    A = Projector(grid, geometry)
    generator = torch.Generator().manual_seed(4)
    counts = simulate_counts(A(disk).expand(2, *A.range_shape), torch.tensor(4e3), generator=generator)
    sinogram = take_log(Scan(counts, torch.tensor(4e3), 0.0, geometry=geometry, mu_water=A.mu_water))
    filtered = fbp(sinogram.line_integrals, A, kernel="ram-lak")
    return LoopScan(sinogram, A, starting_state(sinogram, A), filtered, disk)


@pytest.fixture
def files(dataset: Path) -> list[Path]:
    return [dataset / name for name in read_manifest(dataset).files("train")]


def test_the_images_are_those_of_plug_and_play(scan: LoopScan) -> None:
    torch.manual_seed(1)
    D = RDNCBAM(RDNSize(features=4, growth=4, blocks=1, convolutions=2))
    nn.init.normal_(D.noise.weight, std=0.02)
    images = reconstructed_around(D, scan, sigma_v=45.0, iterations=4)
    method = PlugAndPlay(LearnedDenoiser(D), sigma_v=45.0, iterations=4, stop="never")
    torch.testing.assert_close(images, method(scan.sinogram, scan.A).image, rtol=0, atol=1e-4)


def test_its_gradient_is_that_of_the_images_it_ends_with(scan: LoopScan, monkeypatch: pytest.MonkeyPatch) -> None:
    for tolerance in ("TOLERANCE", "GRADIENT_TOLERANCE"):  # the gradient is that of data steps that are solved
        monkeypatch.setattr(normal_equations, tolerance, 0.01)

    def loss(share: float) -> torch.Tensor:
        D = Blending(share)
        images = reconstructed_around(D, scan, sigma_v=60.0, iterations=THROUGH)
        found = relative_loss(images[0], scan.truth) + relative_loss(images[1], scan.truth)
        found.backward()
        assert D.share.grad is not None
        return torch.stack([found.detach(), D.share.grad])

    step = 0.02
    (below, _), (_, gradient), (above, _) = (loss(0.3 + change) for change in (-step, 0.0, step))
    assert abs(float(gradient)) > 0.1
    assert float(gradient) == pytest.approx(float(above - below) / (2 * step), rel=0.1)


def test_it_denoises_as_the_network_does_alone(scan: LoopScan) -> None:
    torch.manual_seed(1)
    D = RDNCBAM(RDNSize(features=4, growth=4, blocks=1, convolutions=2))
    nn.init.normal_(D.noise.weight, std=0.02)
    with_metal = scan.filtered + 5 * (scan.truth > 0)
    denoised = denoised_by(D, with_metal)
    torch.testing.assert_close(denoised.detach(), LearnedDenoiser(D)(with_metal), rtol=0, atol=1e-5)
    assert not torch.equal(denoised, with_metal)


def test_the_network_alone_counts_too(scan: LoopScan) -> None:
    def loss(filtered: torch.Tensor) -> float:
        losses = through_loop_losses(lambda _: replace(scan, filtered=filtered), 0, Blending(0.3), [0])
        return losses.item()

    exact = scan.truth.expand_as(scan.filtered)
    assert loss(exact) < loss(scan.filtered) - 0.1


def test_loops_are_as_long_as_the_noisier_scan_needs_or_longer(scan: LoopScan, monkeypatch: pytest.MonkeyPatch) -> None:
    def lengths(scan: LoopScan) -> tuple[np.ndarray, np.ndarray]:
        enough, taken = [], []

        def watched(D: nn.Module, scan: LoopScan, *, sigma_v: float, iterations: int) -> torch.Tensor:
            images = PlugAndPlay(lambda image: image, sigma_v=sigma_v, stop="never")(scan.sinogram, scan.A)
            enough.append(images.iterations)
            taken.append(iterations)
            return scan.filtered

        monkeypatch.setattr(through_loop, "reconstructed_around", watched)
        through_loop_losses(lambda _: scan, 3, Blending(0.3), range(12))
        return np.array(enough), np.array(taken)

    weights = DiagonalWeights(scan.sinogram.weights.diagonal / 16, scan.A.geometry.shape)
    noisier = replace(scan, sinogram=replace(scan.sinogram, weights=weights))
    of_scan, of_noisier = lengths(scan), lengths(noisier)
    for enough, taken in (of_scan, of_noisier):
        assert (taken >= enough).all()
        assert taken.max() <= MOST
        assert 0 < (taken > enough).mean() < 0.5
    assert of_noisier[0].mean() > of_scan[0].mean() + 1


def test_an_error_counts_relative_to_itself_in_each_tissue(disk: torch.Tensor, generator: torch.Generator) -> None:
    error = 0.01 * torch.randn(disk.shape, generator=generator)
    once, twice = (relative_loss(disk + factor * error, disk) for factor in (1.0, 2.0))
    assert float(twice - once) == pytest.approx(1.05 * np.log(4), rel=1e-4)
    air = torch.zeros_like(disk)  # neither body nor soft tissue
    assert float(relative_loss(air + 0.1, air)) == pytest.approx(0.05 * np.log(0.01), rel=1e-4)


def test_a_network_that_sharpens_its_own_work_unlearns_it(files: list[Path], dataset: Path) -> None:
    D = Blending(-0.5)
    tried = ClosedLoop(files, (50.0, 50.0))
    before = tried(D)["reconstructed_body"]
    method = ThroughLoop(epochs=4, pairs_per_epoch=2, batch=1, learning_rate=0.1, lowest_ma=50.0, highest_ma=50.0)
    plan = method.plan(D, dataset)
    stages = {epoch.stage for epoch in plan.epochs()}
    assert stages == {"through-loop"}
    assert D.share.item() > -0.4
    assert tried(D)["reconstructed_body"] < before
    assert plan.validate() == {}
    assert ThroughLoop(reconstructed=1).plan(D, dataset).validate().keys() == {"reconstructed_body"}


def test_the_same_number_is_the_same_scan(files: list[Path]) -> None:
    scans, again = (LoopScans(files, (30.0, 200.0), seed=3) for _ in range(2))
    torch.testing.assert_close(scans(1).sinogram.line_integrals, again(1).sinogram.line_integrals, rtol=0, atol=0)
    low, high = scans(0).sinogram.weights.diagonal.mean((1, 2))
    assert low < high  # the second scan has more dose
    assert not torch.equal(scans(0).sinogram.line_integrals, scans(1).sinogram.line_integrals)


def test_discs_lie_in_soft_tissue_and_change_truth_and_scan_alike(files: list[Path], disk: torch.Tensor) -> None:
    tissue = torch.where(disk > 0.5, 1.03, 0.0)
    change = drawn_discs(tissue, 2.0, np.random.default_rng(0))
    assert (change[tissue == 0] == 0).all()
    assert change.abs().max() >= CONTRASTS_HU[0] / 1000
    assert (drawn_discs(torch.zeros(8, 8), 2.0, np.random.default_rng(0)) == 0).all()

    exposed = read_exposure(files[0])
    assert exposed.grid is not None
    A = Projector(exposed.grid, exposed.exposure.geometry, mu_water=exposed.exposure.mu_water)
    more = torch.zeros(exposed.grid.shape)
    more[6:10, 6:10] = 0.05
    exposures = (exposed.exposure, changed(exposed.exposure, more, A))
    plain, denser = (take_log(each.scan(tube_current_ma=1e5, generator=None)) for each in exposures)
    added = denser.line_integrals - plain.line_integrals
    assert float(added.max()) > 0.02
    torch.testing.assert_close(added, A(more), rtol=0.15, atol=1e-3)  # a correction of beam hardening is not linear


def test_what_cannot_be_is_refused(dataset: Path) -> None:
    for option in ({"side": 64}, {"micro_batch": 2}, {"bfloat16": True}):
        with pytest.raises(ValueError, match="whole slices"):
            ThroughLoop(**option)
    with pytest.raises(ValueError, match="noise level is not known"):
        ThroughLoop().plan(RDNCBAM(RDNSize(4, 4, 1, 1), noise_input=True), dataset)
    for option in ({"examples": 0}, {"reconstructed": -1}):
        with pytest.raises(ValueError, match="at least one slice"):
            ThroughLoop(**option)
    for files, currents in (([], (1.0, 2.0)), ([dataset], (2.0, 1.0))):
        with pytest.raises(ValueError, match=r"at least one file|positive and rising"):
            LoopScans(files, currents)


def test_training_leaves_what_the_loop_is_given(scan: LoopScan) -> None:
    kept = copy.deepcopy((scan.sinogram.line_integrals, scan.start.v))
    reconstructed_around(Blending(0.2), scan, sigma_v=60.0, iterations=2)
    torch.testing.assert_close((scan.sinogram.line_integrals, scan.start.v), kept, rtol=0, atol=0)
