import json
from pathlib import Path
from typing import Any

import pytest

from pnpct.files import sha256_of
from pnpct.files.checkpoint import load_network
from pnpct.files.training_file import write_training

TRAIN = "--epochs 2 --fine-tuning-epochs 1 --pairs-per-epoch 2 --batch 2"


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


def test_a_run_that_was_killed_goes_on_and_ends_as_if_it_had_not(
    dataset: Path, tmp_path: Path, run, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole, killed = tmp_path / "whole.safetensors", tmp_path / "killed.safetensors"
    assert run("train", dataset, whole, *TRAIN.split())[0] == 0
    written = []

    def and_die(*args: Any, **options: Any) -> None:
        write_training(*args, **options)
        written.append(args)
        if len(written) == 2:
            raise KeyboardInterrupt

    monkeypatch.setattr("pnpct.cli.train.write_training", and_die)
    run("train", dataset, killed, *TRAIN.split())
    assert not killed.exists()
    monkeypatch.undo()
    status, out, _ = run("train", dataset, killed, *TRAIN.split())
    assert status == 0
    assert "noise-to-noise" not in out
    assert killed.read_bytes() == whole.read_bytes()


def test_a_network_can_be_told_the_noise_level(dataset: Path, tmp_path: Path, run) -> None:
    path = tmp_path / "told.safetensors"
    assert run("train", dataset, path, *TRAIN.split(), "--noise-input", "--licence", "CC0-1.0")[0] == 0
    assert load_network(path).noise_input
    about = json.loads((tmp_path / "told.safetensors.json").read_text())["about"]
    assert about["licence"] == "CC0-1.0"
    assert about["settings"]["noise_input"]


def test_a_damaged_state_is_refused(dataset: Path, tmp_path: Path, run) -> None:
    path = tmp_path / "tiny.safetensors"
    path.with_suffix(".training").write_bytes(b"nothing")
    status, _, err = run("train", dataset, path, *TRAIN.split())
    assert status == 2
    assert "remove it to begin anew" in err


def test_patients_of_further_data_sets_are_learnt_from_too(dataset: Path, tmp_path: Path, run) -> None:
    further = tmp_path / "further"
    words = "--anatomy head --cases 3 --rows 1 --views 24 --bins 60 --size 32 --tube-voltages-kvp 120 --processes 1"
    assert run("simulate", "dataset", further, *words.split())[0] == 0
    losses = []
    for name, words in (("alone", ()), ("both", ("--also", further))):
        status, out, err = run("train", dataset, tmp_path / f"{name}.safetensors", *TRAIN.split(), *words)
        assert (status, err) == (0, "")
        losses.append([line.split(",")[0] for line in out.splitlines()])
    assert losses[0] != losses[1]
    about = json.loads((tmp_path / "both.safetensors.json").read_text())["about"]
    assert about["settings"]["also"] == [sha256_of(further / "manifest.json")]
    status, _, err = run("train", dataset, tmp_path / "c.safetensors", *TRAIN.split(), "--also", tmp_path / "nothing")
    assert status == 2
    assert "nothing" in err


def test_the_loss_of_fine_tuning_can_be_chosen(dataset: Path, tmp_path: Path, run) -> None:
    says = set()
    choices = (
        "--losses corrected",
        "--losses paper",
        "--texture-weight 0",
        "--contrast-weight 3e-4",
        "--reference truth",
        "--reference noise-free",
    )
    for number, words in enumerate(choices):
        status, out, _ = run("train", dataset, tmp_path / f"{number}.safetensors", *TRAIN.split(), *words.split())
        assert status == 0
        line = out.splitlines()[2]
        assert line.startswith("fine-tuning 1: loss")
        says.add(line)
    assert len(says) == len(choices)


@pytest.mark.parametrize(
    ("words", "names"),
    [
        ("--size small --begin-with n2n", "--size --begin-with"),
        ("--noise-input --begin-with n2n", "--noise-input --begin-with"),
        ("--noise-input --size red-cnn", "--noise-input red-cnn"),
        ("--seed -1", "seed"),
        ("--batch 3", "batches of 3"),
        ("--batch 2 --at-once 0", "0 at once"),
        ("--examples 0", "example 0"),
        ("--discount 5000", "discount 0 to 4 5000"),
        ("--discount nan", "discount 0 to 4 nan"),
        ("--batch 2 --learning-rate 0", "learning rate"),
        ("--lowest-ma 300", "Tube currents"),
        ("--reference 100", "high dose 100 mA"),
        ("--texture-weight -1", "from 0 up -1"),
        ("--contrast-weight nan", "from 0 up nan"),
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


SINGLE = "--method single-scan --parts 2 --epochs 2 --pairs-per-epoch 2 --batch 2 --side 32"


@pytest.fixture(scope="module")
def scan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from pnpct.cli import main

    path = tmp_path_factory.mktemp("single") / "scan.h5"
    assert main(["simulate", "scan", str(path), "--size", "48", "--views", "60", "--bins", "100"]) == 0
    return path


def test_a_network_is_trained_on_a_single_scan_and_says_which(scan: Path, tmp_path: Path, run) -> None:
    path = tmp_path / "one.safetensors"
    status, out, err = run("train", scan, path, *SINGLE.split())
    assert (status, err) == (0, "")
    lines = out.splitlines()
    assert [line.partition(": ")[0] for line in lines[:2]] == ["single-scan 1", "single-scan 2"]
    assert all(line.partition(": ")[2].startswith("loss ") and "," not in line for line in lines[:2])
    about = json.loads((tmp_path / "one.safetensors.json").read_text())["about"]
    assert about["manifest_sha256"] == sha256_of(scan)
    assert [loss["stage"] for loss in about["metrics"]["losses"]] == ["single-scan", "single-scan"]
    load_network(path)
    # Once more: nothing is left to do; with other parts it is another training.
    before = path.read_bytes()
    assert run("train", scan, path, *SINGLE.split())[0] == 0
    assert path.read_bytes() == before
    status, _, err = run("train", scan, path, *SINGLE.replace("--parts 2", "--parts 1").split())
    assert status == 2
    assert "other settings (parts)" in err


@pytest.mark.parametrize(
    "words",
    [
        "--also other",
        "--loop-denoiser tv",
        "--loop-iterations 3",
        "--loop-images 1",
        "--kept images",
        "--examples 1000",
        "--lowest-ma 20",
        "--highest-ma 200",
        "--reference 800",
    ],
)
def test_options_of_a_data_set_are_refused_for_a_single_scan(tmp_path: Path, run, words: str) -> None:
    name = words.split()[0]
    status, _, err = run(
        "train", tmp_path / "a.h5", tmp_path / "a.safetensors", "--method", "single-scan", *words.split()
    )
    assert status == 2
    assert err == (
        f"pnpct: {name} has no effect on --method single-scan, but on two-stage or supervised; leave out one of them.\n"
    )


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


@pytest.mark.parametrize(
    ("words", "names"),
    [
        ("{scan}", "scan.h5 file folder single-scan"),
        ("{scan} --method supervised", "scan.h5 file folder single-scan"),
        ("{here} --method single-scan", "folder scan"),
        ("{here}/none.h5 --method single-scan", "none.h5"),
        ("{scan} --method single-scan --parts 1", "two parts 1"),
        ("{scan} --method single-scan --parts 3", "30 views 60"),
        ("{scan} --method single-scan --noise-input", "--noise-input single scan"),
        ("{scan} --method single-scan --parts 2 --side 99", "square of 99 pixels"),
    ],
)
def test_what_a_method_cannot_learn_from_is_one_sentence(
    scan: Path, tmp_path: Path, run, words: str, names: str
) -> None:
    data, *rest = words.format(scan=scan, here=tmp_path).split()
    status, _, err = run("train", data, tmp_path / "a.safetensors", *rest)
    assert status == 2
    assert err.count("\n") == 1
    missing = [name for name in names.split() if name not in err]
    assert not missing, err
    assert not list(tmp_path.iterdir())
