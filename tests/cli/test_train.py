import json
from pathlib import Path

import pytest

from pnpct.files.checkpoint import load_network

DATASET = "--anatomy pelvis --cases 3 --rows 1 --views 24 --bins 60 --size 32 --tube-voltages-kvp 120 --processes 1"
TRAIN = "--epochs 2 --fine-tuning-epochs 1 --pairs-per-epoch 2 --batch 2"


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from pnpct.cli import main

    folder = tmp_path_factory.mktemp("train") / "set"
    assert main(["simulate", "dataset", str(folder), *DATASET.split()]) == 0
    return folder


def test_a_network_is_trained_and_says_what_it_is(dataset: Path, tmp_path: Path, run) -> None:
    path = tmp_path / "tiny.safetensors"
    status, out, err = run("train", dataset, path, *TRAIN.split())
    assert (status, err) == (0, "")
    assert out.count("noise-to-noise") == 2
    assert out.count("fine-tuning") == 1
    assert sum(parameter.numel() for parameter in load_network(path).parameters()) == 168_224
    about = json.loads((tmp_path / "tiny.safetensors.json").read_text())["about"]
    assert len(about["metrics"]["losses"]) == 3
    assert about["seed"] == 0
    # Once more: nothing is left to do, and the files are the same.
    before = path.read_bytes()
    assert run("train", dataset, path, *TRAIN.split())[0] == 0
    assert path.read_bytes() == before


def test_training_with_other_settings_is_not_continued(dataset: Path, tmp_path: Path, run) -> None:
    path = tmp_path / "tiny.safetensors"
    assert run("train", dataset, path, *TRAIN.split())[0] == 0
    status, _, err = run("train", dataset, path, *TRAIN.split(), "--seed", "5")
    assert status == 2
    assert "other settings (seed)" in err


@pytest.mark.parametrize(
    ("words", "names"),
    [
        ("--batch 3", "batches of 3"),
        ("--batch 2 --learning-rate 0", "learning rate"),
        ("--lowest-ma 300", "Tube currents"),
        ("--size huge", "--size small medium original red-cnn"),
    ],
)
def test_what_cannot_be_is_one_sentence(dataset: Path, tmp_path: Path, run, words: str, names: str) -> None:
    status, _, err = run("train", dataset, tmp_path / "a.safetensors", "--pairs-per-epoch", "2", *words.split())
    assert status == 2
    assert err.count("\n") == 1
    assert all(name in err for name in names.split())
    assert not list(tmp_path.iterdir())


def test_what_is_not_a_data_set_is_refused(tmp_path: Path, run) -> None:
    status, _, err = run("train", tmp_path, tmp_path / "a.safetensors")
    assert status == 2
    assert "manifest.json" in err
