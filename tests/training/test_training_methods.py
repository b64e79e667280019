"""The ways to train: what their options do, on a data set of three heads."""

import json
from dataclasses import fields, replace
from pathlib import Path

import pytest
import torch
from torch import nn

from pnpct.denoisers import RDNCBAM, RDNSize
from pnpct.files import save_network, sha256_of
from pnpct.files.checkpoint import ABOUT
from pnpct.geometry import FanBeam, ImageGrid
from pnpct.physics import Scan
from pnpct.training import METHODS, Epoch, SingleScan, Supervised, TwoStage, validate, validation

TINY = RDNSize(features=4, growth=4, blocks=1, convolutions=2)
SHORT = {"epochs": 1, "pairs_per_epoch": 2, "batch": 2}


class Unchanged(nn.Linear):
    def forward(self, image: torch.Tensor) -> torch.Tensor:
        return image


def network(**options: bool) -> RDNCBAM:
    """A network that changes images, as a new one does not."""
    torch.manual_seed(1)
    D = RDNCBAM(TINY, **options)
    nn.init.normal_(D.noise.weight, std=0.02)
    return D


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("cache")


@pytest.fixture(scope="module")
def tiny(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("network") / "tiny.safetensors"
    save_network(path, network(), about=dict.fromkeys(ABOUT))
    return path


@pytest.fixture
def scan(geometry: FanBeam) -> Scan:
    return Scan(torch.full(geometry.shape, 1e3), torch.tensor(1e4), 0.0, geometry=geometry, mu_water=0.0193)


def test_without_noise_each_image_has_a_reference_of_its_own_kind(dataset: Path) -> None:
    method = Supervised(loop_iterations=3, loop_images=2, reference="noise-free", lowest_ma=1e6, highest_ma=1e6)
    quiet = method.examples_from(dataset, "train")(0)
    torch.testing.assert_close(quiet.low[0], quiet.references[0], rtol=0, atol=0.02)
    assert (quiet.references[1] - quiet.references[0]).abs().max() > 0.1


def test_validation_is_the_rms_difference_of_the_pair_in_the_middle(dataset: Path) -> None:
    examples = Supervised(loop_iterations=2, loop_images=2).examples_from(dataset, "train")
    drawn = [examples(number) for number in range(validation.VALIDATION_EXAMPLES)]
    pairs = {
        "fbp": [example.low[0] - example.references[0] for example in drawn],
        "loop": [image for example in drawn for image in example.others - example.references[1:]],
    }
    errors = {
        name: float(torch.stack(found).square().mean((1, 2)).quantile(0.5)) ** 0.5 for name, found in pairs.items()
    }
    found = validate(Unchanged(1, 1), drawn.__getitem__)
    assert found == pytest.approx({name: 1000 * error for name, error in errors.items()}, rel=1e-4)


def test_each_option_of_fine_tuning_changes_it(dataset: Path, cache: Path) -> None:
    usual = TwoStage(**SHORT, fine_tuning_epochs=1, cache=cache)
    others: list[dict[str, object]] = [
        {},
        {"losses": "paper"},
        {"losses": "paper", "texture_weight": 0.0},  # the corrected term is 0 where the output has texture enough
        {"contrast_weight": 3e-4},
        {"reference": "truth"},
        {"reference": "noise-free"},
    ]
    first, second = set(), set()
    for changes in others:
        noisy, tuned = replace(usual, **changes).plan(network(), dataset).epochs()
        first.add(noisy.loss)
        second.add(tuned.loss)
    assert (len(first), len(second)) == (1, len(others))


def test_a_plan_goes_on_after_an_epoch(dataset: Path, cache: Path) -> None:
    method = TwoStage(**SHORT, fine_tuning_epochs=1, cache=cache)
    plan = method.plan(network(), dataset)
    whole = list(plan.epochs())
    assert [epoch.stage for epoch in whole] == ["noise-to-noise", "fine-tuning"]
    assert plan.total == 2
    (last,) = method.plan(network(), dataset).epochs(after=whole[0])
    assert isinstance(last, Epoch)
    assert last.loss == whole[1].loss


def test_a_network_can_denoise_in_the_loop_and_compute_in_bfloat16(dataset: Path, tiny: Path) -> None:
    exact = Supervised(**SHORT, loop_denoiser=str(tiny))
    losses = [
        [epoch.loss for epoch in method.plan(network(), dataset).epochs()]
        for method in (exact, replace(exact, bfloat16=True))
    ]
    assert losses[0] != losses[1]
    assert losses[0] == pytest.approx(losses[1], rel=0.05)


def test_a_noise_conditioned_network_learns_neither_in_the_loop_nor_from_a_single_scan(
    dataset: Path, tmp_path: Path, scan: Scan, grid: ImageGrid
) -> None:
    path = tmp_path / "conditioned.safetensors"
    save_network(path, network(noise_input=True), about=dict.fromkeys(ABOUT))
    with pytest.raises(ValueError, match=r"conditioned.safetensors is noise-conditioned, but the loop"):
        Supervised(loop_denoiser=str(path)).plan(network(), dataset)
    with pytest.raises(ValueError, match="noise-conditioned network cannot learn from a single scan"):
        SingleScan().plan(network(noise_input=True), scan, grid)


def test_a_single_scan_is_learnt_from_without_a_reference(scan: Scan, grid: ImageGrid) -> None:
    plan = SingleScan(**SHORT, parts=2).plan(network(), scan, grid)
    assert [epoch.stage for epoch in plan.epochs()] == ["single-scan"]
    assert plan.validate() == {}


@pytest.mark.parametrize("name", METHODS)
def test_the_settings_name_what_the_weights_depend_on_and_nothing_else(name: str, dataset: Path) -> None:
    method = METHODS[name]()
    settings = method.settings()
    assert set(settings) == {field.name for field in fields(method)} - {"micro_batch", "cache", "reconstructed"}
    assert json.loads(json.dumps(settings)) == settings
    if isinstance(method, Supervised):
        further = replace(method, also=(dataset,), loop_denoiser="n2n").settings()
        assert further["also"] == [sha256_of(dataset / "manifest.json")]
        assert len(further["loop_denoiser"]) == 64


def test_a_part_without_patients_is_refused(dataset: Path, tmp_path: Path) -> None:
    manifest = json.loads((dataset / "manifest.json").read_text())
    manifest["scans"] = [scan for scan in manifest["scans"] if scan["split"] != "validation"]
    (tmp_path / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(ValueError, match="no patients for validation; simulate more"):
        Supervised().plan(network(), tmp_path)


def test_validation_changes_no_network(dataset: Path) -> None:
    class Normalised(Unchanged):
        def __init__(self) -> None:
            super().__init__(1, 1)
            self.batch = torch.nn.BatchNorm2d(1)

        def forward(self, image: torch.Tensor) -> torch.Tensor:
            return super().forward(self.batch(image[:, None])[:, 0])

    network = Normalised().train()
    before = {name: value.clone() for name, value in network.state_dict().items()}
    validate(network, Supervised(loop_iterations=1).examples_from(dataset, "train"))
    assert all(torch.equal(value, before[name]) for name, value in network.state_dict().items())
    assert network.training
