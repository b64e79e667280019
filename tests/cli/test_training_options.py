"""The options of `pnpct train`: they arrive in the method, and are refused where they have no effect."""

from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest

from pnpct.cli.parsing import parse
from pnpct.cli.train import Train
from pnpct.cli.training_options import TrainingOptions
from pnpct.training import METHODS, ImagePairs, NeighbouringSlices, SingleScan, Supervised, ThroughLoop, TwoStage


@pytest.mark.parametrize("name", METHODS)
def test_the_defaults_are_those_of_the_method(name: str) -> None:
    assert parse(Train, ["data", "a.safetensors", "--method", name], program="pnpct").chosen_method() == METHODS[name]()


def test_every_option_arrives_in_the_method() -> None:
    shared = "--epochs 3 --pairs-per-epoch 6 --batch 2 --side 32 --learning-rate 0.5 --micro-batch 1 --seed 7"
    of_all: dict[str, Any] = {"epochs": 3, "pairs_per_epoch": 6, "batch": 2, "side": 32, "learning_rate": 0.5}
    of_all |= {"micro_batch": 1, "seed": 7, "bfloat16": True}
    words = (
        "--bfloat16 --also b c --loop-denoiser n2n --loop-iterations 5 --loop-images 2 --fine-tuning-epochs 4 "
        "--losses paper --texture-weight 0.1 --contrast-weight 0.2 --examples 9 --cache images --lowest-ma 30 "
        "--highest-ma 40 --reference noise-free --discount 2 --reconstructed 3"
    )
    given: dict[str, Any] = {"also": (Path("b"), Path("c")), "loop_denoiser": "n2n", "loop_iterations": 5}
    given |= {"loop_images": 2, "fine_tuning_epochs": 4, "losses": "paper", "texture_weight": 0.1}
    given |= {"contrast_weight": 0.2, "examples": 9, "cache": Path("images"), "lowest_ma": 30.0, "highest_ma": 40.0}
    given |= {"reference": "noise-free", "discount": 2.0, "reconstructed": 3}

    def method(words: str) -> Supervised | ThroughLoop | SingleScan | NeighbouringSlices:
        return parse(Train, ["data", "a.safetensors", *words.split()], program="pnpct").chosen_method()

    assert method(f"{shared} {words}") == TwoStage(**of_all, **given)
    assert method(f"{shared} --bfloat16 --method single-scan --parts 3") == SingleScan(**of_all, parts=3)
    images = "--low quarter --validation L2 L3 --high full"
    assert method(f"{shared} --bfloat16 --method image-pairs {images}") == ImagePairs(
        **of_all, low="quarter", high="full", validation=("L2", "L3")
    )
    whole = {"also": (Path("b"),), "examples": 9, "lowest_ma": 30.0, "highest_ma": 40.0, "reconstructed": 3}
    words = "--epochs 3 --batch 2 --also b --examples 9 --lowest-ma 30 --highest-ma 40 --reconstructed 3"
    assert method(f"{words} --method through-loop") == ThroughLoop(epochs=3, batch=2, **whole)
    options = {field.name for field in fields(TrainingOptions)}
    assert options == {*of_all, *given, "parts", "low", "high", "validation", "method"}
    assert options == {"method"} | {field.name for kind in METHODS.values() for field in fields(kind)}


@pytest.mark.parametrize(
    "words",
    [
        "--also other",
        "--loop-denoiser tv",
        "--loop-iterations 3",
        "--loop-images 1",
        "--cache images",
        "--examples 1000",
        "--lowest-ma 20",
        "--highest-ma 200",
        "--reference 800",
    ],
)
def test_options_of_a_data_set_are_refused_for_a_single_scan(tmp_path: Path, run, words: str) -> None:
    name = words.split()[0]
    shared = name in ("--also", "--examples", "--lowest-ma", "--highest-ma")
    others = "two-stage or supervised or through-loop" if shared else "two-stage or supervised"
    status, _, err = run(
        "train", tmp_path / "a.h5", tmp_path / "a.safetensors", "--method", "single-scan", *words.split()
    )
    assert status == 2
    assert err == f"pnpct: {name} has no effect on --method single-scan, but on {others}; leave out one of them.\n"


@pytest.mark.parametrize("method", ["supervised", "single-scan"])
def test_fine_tuning_is_of_two_stages_alone(tmp_path: Path, run, method: str) -> None:
    words = ("--method", method, "--fine-tuning-epochs", "20")
    status, _, err = run("train", tmp_path, tmp_path / "a.safetensors", *words)
    assert status == 2
    assert err == (
        f"pnpct: --fine-tuning-epochs has no effect on --method {method}, but on two-stage; leave out one of them.\n"
    )


def test_parts_are_refused_for_a_data_set(tmp_path: Path, run) -> None:
    status, _, err = run("train", tmp_path, tmp_path / "a.safetensors", "--parts", "4")
    assert status == 2
    assert err == "pnpct: --parts has no effect on --method two-stage, but on single-scan; leave out one of them.\n"
