import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import torch

from pnpct.cli.training_images import LoopImages, fbp_image, unchanged
from pnpct.cli.training_setup import VALIDATION_PAIRS, examples_of, validate
from pnpct.denoisers import RDNCBAM, RDNSize
from pnpct.files import sha256_of
from pnpct.files.checkpoint import ABOUT, load_network, save_network
from pnpct.reconstruction import DAMPING

TRAIN = "--epochs 2 --fine-tuning-epochs 1 --pairs-per-epoch 2 --batch 2"
TINY = RDNSize(features=4, growth=4, blocks=1, convolutions=2)


def test_without_noise_each_image_has_a_reference_of_its_own_kind(dataset: Path) -> None:
    loop = {"loop_denoiser": None, "loop_iterations": 5, "loop_images": 2}
    options = {**loop, "bfloat16": False, "device": torch.device("cpu"), "seed": 0}
    examples = examples_of([dataset], "train", reference="noise-free", **options)
    assert examples.make_references == (fbp_image, LoopImages(unchanged, "none", 5, 2))
    quiet = examples_of([dataset], "train", reference="noise-free", tube_currents_ma=(1e6, 1e6), **options)(0)
    torch.testing.assert_close(quiet.low[0], quiet.references[0], rtol=0, atol=0.02)
    assert (quiet.references[1] - quiet.references[0]).abs().max() > 0.1

    class Unchanged(torch.nn.Linear):
        def forward(self, image: torch.Tensor) -> torch.Tensor:
            return image

    drawn = [examples(number) for number in range(VALIDATION_PAIRS)]
    pairs = {
        "fbp": [example.low[0] - example.references[0] for example in drawn],
        "loop": [image for example in drawn for image in example.others - example.references[1:]],
    }
    errors = {
        name: float(torch.stack(found).square().mean((1, 2)).quantile(0.5)) ** 0.5 for name, found in pairs.items()
    }
    assert validate(Unchanged(1, 1), examples) == pytest.approx({k: 1000 * e for k, e in errors.items()}, rel=1e-4)


@pytest.mark.parametrize("images", ["0", "4"])
def test_a_loop_has_as_many_images_as_iterations(dataset: Path, tmp_path: Path, run, images: str) -> None:
    status, _, err = run("train", dataset, tmp_path / "a.safetensors", *TRAIN.split(), "--loop-images", images)
    assert status == 2
    assert err == f"pnpct: 3 iterations give 1 to 3 images, not {images}.\n"


@pytest.fixture(scope="module")
def tiny(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("network") / "tiny.safetensors"
    save_network(path, RDNCBAM(TINY), about=dict.fromkeys(ABOUT))
    return path


def test_the_loop_is_damped_around_a_network_alone(dataset: Path, tiny: Path) -> None:
    loop = {"loop_iterations": 5, "loop_images": 2, "bfloat16": False, "device": torch.device("cpu"), "seed": 0}
    (around_tv,) = examples_of([dataset], "train", reference=800, loop_denoiser=None, **loop).others
    (around_network,) = examples_of([dataset], "train", reference=800, loop_denoiser=str(tiny), **loop).others
    assert (around_tv.damping, around_network.damping) == (0, DAMPING)


def test_a_network_can_denoise_in_the_loop_and_compute_in_bfloat16(dataset: Path, tiny: Path, tmp_path: Path, run):
    def losses(name: str, *words: str) -> list[float]:
        path = tmp_path / f"{name}.safetensors"
        status = run("train", dataset, path, *TRAIN.split(), "--loop-denoiser", tiny, *words)[0]
        assert status == 0
        about = json.loads(path.with_suffix(".safetensors.json").read_text())["about"]
        assert about["settings"]["loop_denoiser"] == sha256_of(tiny)
        return [epoch["loss"] for epoch in about["metrics"]["losses"]]

    exact, fewer_digits = losses("exact"), losses("fewer", "--bfloat16")
    assert fewer_digits != exact
    assert fewer_digits == pytest.approx(exact, rel=0.05)


def test_a_network_that_is_told_the_noise_level_cannot_denoise_in_the_loop(dataset: Path, tmp_path: Path, run) -> None:
    told = tmp_path / "told.safetensors"
    save_network(told, RDNCBAM(TINY, noise_input=True), about=dict.fromkeys(ABOUT))
    status, _, err = run("train", dataset, tmp_path / "a.safetensors", *TRAIN.split(), "--loop-denoiser", told)
    assert status == 2
    assert err == f"pnpct: {told} is told the noise level, which the loop of training does not know.\n"


def test_processes_that_torchrun_started_share_the_work_and_one_writes(dataset: Path, tmp_path: Path, run) -> None:
    alone, shared = tmp_path / "alone.safetensors", tmp_path / "shared.safetensors"
    assert run("train", dataset, alone, *TRAIN.split())[0] == 0
    started = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node=2"]
    words = [str(Path(sys.executable).with_name("pnpct")), "train", str(dataset), str(shared), *TRAIN.split()]
    done = subprocess.run([*started, *words], env=dict(os.environ, OMP_NUM_THREADS="1"), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("Wrote") == 1
    one, other = (load_network(path).state_dict() for path in (alone, shared))
    for name, value in one.items():
        torch.testing.assert_close(other[name], value, rtol=1e-3, atol=1e-5)
