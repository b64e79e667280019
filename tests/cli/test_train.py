"""`pnpct train`: from a data set to the file of a network."""

import json
import os
import shutil
import socket
from datetime import timedelta
from functools import partial
from pathlib import Path
from typing import Any

import pytest
import torch
from torch import distributed

from pnpct.files import load_network, read_exposure, read_manifest, sha256_of
from pnpct.files.checkpoint import finest_pixel
from pnpct.files.training_file import write_training

TRAIN = "--epochs 2 --fine-tuning-epochs 1 --pairs-per-epoch 2 --batch 2"


@pytest.fixture(scope="module")
def cached(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, ...]:
    """The options of a small training, whose examples are made once for all tests."""
    return (*TRAIN.split(), "--cache", str(tmp_path_factory.mktemp("examples")))


@pytest.fixture(scope="module")
def trained(dataset: Path, cached: tuple[str, ...], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A network that the command has trained, and beside it the state in which it ended."""
    from pnpct.cli import main

    path = tmp_path_factory.mktemp("trained") / "tiny.safetensors"
    assert main(["train", str(dataset), str(path), *cached]) == 0
    return path


@pytest.fixture
def again(trained: Path, tmp_path: Path) -> Path:
    """A place for a network beside the state of the training that has ended."""
    shutil.copy(trained.with_suffix(".training"), tmp_path / "tiny.training")
    return tmp_path / "tiny.safetensors"


def said_of(path: Path) -> dict[str, Any]:
    return json.loads(path.with_suffix(".safetensors.json").read_text())["about"]


def test_a_network_is_trained_and_says_what_it_is(trained: Path, dataset: Path) -> None:
    assert sum(parameter.numel() for parameter in load_network(trained).parameters()) == 168_224
    about = said_of(trained)
    assert [(loss["stage"], loss["epoch"]) for loss in about["metrics"]["losses"]] == [
        ("noise-to-noise", 1),
        ("noise-to-noise", 2),
        ("fine-tuning", 1),
    ]
    assert about["seed"] == 0
    assert about["manifest_sha256"] == sha256_of(dataset / "manifest.json")
    assert {"losses": "corrected", "fine_tuning_epochs": 1, "batch": 2}.items() <= about["settings"].items()
    files = read_manifest(dataset).files("train")
    pixels = [grid.spacing for file in files if (grid := read_exposure(dataset / file).grid) is not None]
    assert finest_pixel(trained) == min(pixels)
    assert len(pixels) == len(files)


def test_a_training_that_has_ended_is_not_repeated(trained: Path, dataset: Path, again: Path, cached, run) -> None:
    status, out, err = run("train", dataset, again, *cached)
    assert (status, err) == (0, "")
    assert out == f"Wrote {again}: a network after 3 epochs.\n"
    assert again.read_bytes() == trained.read_bytes()


def test_training_with_other_settings_is_not_continued(dataset: Path, again: Path, cached, run) -> None:
    status, _, err = run("train", dataset, again, *cached, "--seed", "5")
    assert status == 2
    assert "other settings (seed)" in err


def test_a_run_that_was_killed_goes_on_and_ends_as_if_it_had_not(
    trained: Path, dataset: Path, tmp_path: Path, cached, run, monkeypatch: pytest.MonkeyPatch
) -> None:
    killed = tmp_path / "killed.safetensors"
    written = []

    def and_die(*args: Any, **options: Any) -> None:
        write_training(*args, **options)
        written.append(args)
        if len(written) == 2:
            raise KeyboardInterrupt

    monkeypatch.setattr("pnpct.cli.train.write_training", and_die)
    run("train", dataset, killed, *cached)
    assert not killed.exists()
    monkeypatch.undo()
    status, out, _ = run("train", dataset, killed, *cached)
    assert status == 0
    assert [line.partition(": ")[0] for line in out.splitlines()] == ["fine-tuning 1", f"Wrote {killed}"]
    assert killed.read_bytes() == trained.read_bytes()


def test_a_noise_conditioned_network_can_be_made_under_a_licence(dataset: Path, tmp_path: Path, run, cached) -> None:
    path = tmp_path / "conditioned.safetensors"
    words = (*cached, "--noise-input", "--licence", "CC0-1.0")
    assert run("train", dataset, path, *words)[0] == 0
    assert load_network(path).noise_input
    about = said_of(path)
    assert about["licence"] == "CC0-1.0"
    assert about["settings"]["noise_input"]


def test_a_damaged_state_is_refused(dataset: Path, tmp_path: Path, run) -> None:
    path = tmp_path / "tiny.safetensors"
    path.with_suffix(".training").write_bytes(b"nothing")
    status, _, err = run("train", dataset, path, *TRAIN.split())
    assert status == 2
    assert "remove it to start again" in err


@pytest.mark.parametrize(
    "change",
    [
        lambda state: state["epoch"].update(number=10**9),
        lambda state: state["epoch"].update(number="2"),
        lambda state: state["epoch"].update(loss=None),
        lambda state: state["epoch"].update(stage=["fine-tuning"]),
        lambda state: state["epoch"].update(stage="single-scan"),
        lambda state: state["epoch"].pop("optimizer"),
        lambda state: state["epoch"]["optimizer"].update(state=7),
        lambda state: state["epoch"]["optimizer"].update(param_groups=[]),
        lambda state: state["epoch"]["optimizer"]["state"][0].update(exp_avg=torch.zeros(3)),
        lambda state: state["epoch"]["weights"].popitem(),
        lambda state: state["epoch"]["latest"].popitem(),
        lambda state: state["epoch"].update(weights=[1, 2]),
        lambda state: state.update(losses=3),
    ],
)
def test_a_state_of_wrong_inner_types_is_refused(dataset: Path, again: Path, cached, run, change) -> None:
    path = again.with_suffix(".training")
    content = torch.load(path, weights_only=True)
    content["state"]["epoch"]["number"] = 1
    change(content["state"])
    torch.save(content, path)
    status, _, err = run("train", dataset, again, *cached)
    assert status == 2
    assert err.count("\n") == 1
    assert "start again" in err or "cannot be continued" in err
    assert not again.exists()


def test_patients_of_further_data_sets_are_learnt_from_too(
    trained: Path, dataset: Path, tmp_path: Path, run, cached
) -> None:
    further = tmp_path / "further"
    shutil.copytree(dataset, further)
    manifest = json.loads((further / "manifest.json").read_text())
    splits = {"train": "validation", "validation": "test", "test": "train"}
    manifest["scans"] = [{**scan, "split": splits[scan["split"]]} for scan in manifest["scans"]]
    (further / "manifest.json").write_text(json.dumps(manifest))
    path = tmp_path / "both.safetensors"
    status, _, err = run("train", dataset, path, *cached, "--also", further)
    assert (status, err) == (0, "")
    losses = [[loss["loss"] for loss in said_of(each)["metrics"]["losses"]] for each in (trained, path)]
    assert losses[0] != losses[1]
    assert said_of(path)["settings"]["also"] == [sha256_of(further / "manifest.json")]
    status, _, err = run("train", dataset, tmp_path / "c.safetensors", *cached, "--also", tmp_path / "nothing")
    assert status == 2
    assert "nothing" in err


@pytest.mark.parametrize(
    ("words", "names"),
    [
        ("--size small --begin-with n2n", "--size --begin-with"),
        ("--noise-input --begin-with n2n", "--noise-input --begin-with"),
        ("--noise-input --size red-cnn", "--noise-input red-cnn"),
        ("--seed -1", "seed"),
        ("--batch 3", "batches of 3"),
        ("--batch 2 --micro-batch 0", "0 in a micro-batch"),
        ("--examples 0", "example 0"),
        ("--discount 5000", "discount 0 to 4 5000"),
        ("--discount nan", "discount 0 to 4 nan"),
        ("--batch 2 --learning-rate 0", "learning rate"),
        ("--lowest-ma 300", "Tube currents"),
        ("--reference 100", "high dose 100 mA"),
        ("--texture-weight -1", "from 0 up -1"),
        ("--contrast-weight nan", "from 0 up nan"),
        ("--size huge", "--size small medium original red-cnn"),
        ("--loop-images 4", "3 iterations give 1 to 3 images, not 4"),
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
    assert "holds no data set; make one by pnpct simulate dataset" in err


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are not copied on this system")
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")  # the copy needs no other thread
def test_processes_that_torchrun_started_have_the_losses_of_one_and_one_writes(
    trained: Path, dataset: Path, tmp_path: Path, cached: tuple[str, ...], run, monkeypatch: pytest.MonkeyPatch
) -> None:
    # This process is the first of the two: torchrun would start a third one, and say the same to both.
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = str(free.getsockname()[1])
    for name, value in {"MASTER_ADDR": "127.0.0.1", "MASTER_PORT": port, "WORLD_SIZE": "2", "RANK": "0"}.items():
        monkeypatch.setenv(name, value)
    join = partial(distributed.init_process_group, timeout=timedelta(minutes=2))
    monkeypatch.setattr(distributed, "init_process_group", join)
    shared = tmp_path / "shared.safetensors"
    words = ("train", dataset, shared, *cached)
    # The second begins as a copy of the first, which has imported everything.
    if not (second := os.fork()):
        torch.set_num_threads(1)
        os.environ["RANK"] = "1"
        try:
            (tmp_path / "second.txt").write_text(run(*words)[1])
        finally:
            os._exit(0)
    status, out, err = run(*words)
    assert os.waitpid(second, 0)[1] == 0
    of_second = (tmp_path / "second.txt").read_text()
    assert (status, err) == (0, "")
    assert (out.count("Wrote"), of_second.count("Wrote")) == (1, 0)
    both, alone = (said_of(path)["metrics"]["losses"] for path in (shared, trained))
    assert [loss["loss"] for loss in both] == pytest.approx([loss["loss"] for loss in alone], rel=1e-4)
    one, other = (load_network(path).state_dict() for path in (trained, shared))
    for name, value in one.items():
        torch.testing.assert_close(other[name], value, rtol=1e-3, atol=1e-5)


def test_a_network_goes_on_through_the_loop(trained: Path, dataset: Path, tmp_path: Path, run) -> None:
    begin = ("--method", "through-loop", "--begin-with", trained, "--pairs-per-epoch", "2", "--batch", "2")
    whole, resumed = tmp_path / "whole.safetensors", tmp_path / "resumed.safetensors"
    status, out, _ = run("train", dataset, whole, *begin, "--epochs", "2", "--reconstructed", "1")
    assert status == 0
    assert "reconstructed_body" in out
    assert [loss["stage"] for loss in said_of(whole)["metrics"]["losses"]] == 2 * ["through-loop"]
    assert any(
        not torch.equal(one, other)
        for one, other in zip(load_network(whole).parameters(), load_network(trained).parameters(), strict=True)
    )
    status, _, err = run("train", dataset, resumed, *begin, "--side", "8")
    assert status == 2
    assert "side" in err
    assert not resumed.exists()
