"""Commands that are killed, with real workers: nothing is left, and what is resumed ends as if it had not been."""

import json
import os
import random
import shutil
import signal
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest
from killing import contents, finish, start

DATASET = "--anatomy head --cases 3 --stations 2 --rows 2 --views 60 --bins 120 --size 48 --tube-voltages-kvp 120"
TRAIN = "--epochs 3 --fine-tuning-epochs 2 --pairs-per-epoch 2 --batch 2"
COMPARE = "--iterations 1 --tv-strength 0 --lesion-hu 0 --phantom-repeats 0 --tube-currents-ma 50"
SIGNALS = [signal.SIGTERM, signal.SIGHUP, signal.SIGINT, signal.SIGKILL]
KILLS = int(os.environ.get("PNPCT_KILLS", "4"))
"""At any moment, of each command."""


def count(folder: Path) -> int:
    """How many files there are, temporary ones included, which may be gone when they are looked at."""
    return sum(1 for _ in folder.rglob("*.*"))


def kill(words, folder: Path, number: int, files: int):
    """Start, kill when the folder has some files more than now, and say how that has ended."""
    begun = count(folder)
    with start(words) as process:
        end = time.monotonic() + 120
        while process.poll() is None and count(folder) < begun + files and time.monotonic() < end:
            time.sleep(0.02)
        process.send_signal(number)
        _, err = process.communicate(timeout=60)
    return process.returncode, err


def times(folder: Path) -> set[tuple[str, int]]:
    """Files and when they were written; one that goes meanwhile is none."""
    found = set()
    for path in folder.rglob("*"):
        with suppress(FileNotFoundError):
            found.add((str(path), path.stat().st_mtime_ns))
    return found


def kill_often(words: Callable[[Path], list], whole: Path, killed: Path, same: Callable[[Path, Path], None]):
    """Kill a command at moments of chance after it has written something, and compare each time that it ends."""
    chance, kills, ends = random.Random(1), 0, 1
    finish(words(whole))
    while kills < KILLS:
        killed.mkdir(exist_ok=True)
        before, number = times(killed), SIGNALS[kills % len(SIGNALS)]
        with start(words(killed)) as process:
            while process.poll() is None and times(killed) == before:
                time.sleep(0.01)
            time.sleep(chance.uniform(0.0, 1.0))
            process.send_signal(number)
            _, err = process.communicate(timeout=120)
        leaving = number != signal.SIGKILL and process.returncode == -number  # Python is, after the command has ended
        if process.returncode and not leaving:
            check_end(number, process.returncode, err)
            kills += 1
        else:
            same(whole, killed)
            shutil.rmtree(killed)
            ends += 1
    finish(words(killed))
    same(whole, killed)
    print(f"{kills} kills, {ends} ends")


def same_data_set(whole: Path, killed: Path):
    made, resumed = contents(whole), contents(killed)
    assert made.keys() == resumed.keys()
    assert {name for name in made if made[name] != resumed[name]} <= {"manifest.json.json"}


def same_training(whole: Path, killed: Path):
    made, resumed = contents(whole), contents(killed)
    assert made.keys() == resumed.keys()
    assert made["net.safetensors"] == resumed["net.safetensors"]


def same_comparison(whole: Path, killed: Path):
    made, resumed = contents(whole), contents(killed)
    assert made.keys() == resumed.keys()
    numbers = [json.loads(each["metrics.json"]) for each in (made, resumed)]
    for name in ("fidelity", "texture", "histogram"):
        assert numbers[0][name] == numbers[1][name]


@pytest.mark.slow
@pytest.mark.parametrize("number", SIGNALS)
def test_a_data_set_is_resumed(number, tmp_path):
    words = ["simulate", "dataset", *DATASET.split(), "--processes", 2]
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    finish([*words, whole])
    for files in (1, 3):
        check_end(number, *kill([*words, killed], killed, number, files))
    if number != signal.SIGKILL:
        assert not [name for name in contents(killed) if Path(name).name.startswith(".")]
    finish([*words, killed])
    same_data_set(whole, killed)


@pytest.mark.slow
def test_a_data_set_is_resumed_whenever_it_was_killed(tmp_path):
    words = ["simulate", "dataset", *DATASET.split(), "--processes", 2]
    kill_often(lambda folder: [*words, folder], tmp_path / "whole", tmp_path / "killed", same_data_set)


@pytest.mark.slow
@pytest.mark.parametrize("number", SIGNALS)
def test_a_training_is_resumed(number, dataset, tmp_path):
    words = ["train", dataset, *TRAIN.split(), "--cache", tmp_path / "examples"]
    for name in ("whole", "killed"):
        (tmp_path / name).mkdir()
    whole, killed = tmp_path / "whole" / "net.safetensors", tmp_path / "killed" / "net.safetensors"
    finish([*words, whole])
    check_end(number, *kill([*words, killed], killed.parent, number, 2))
    finish([*words, killed])
    same_training(whole.parent, killed.parent)


@pytest.mark.slow
def test_a_training_is_resumed_whenever_it_was_killed(dataset, tmp_path):
    words = ["train", dataset, *TRAIN.split(), "--cache", tmp_path / "examples"]
    (tmp_path / "whole").mkdir()
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    kill_often(lambda folder: [*words, folder / "net.safetensors"], whole, killed, same_training)
    assert not list((tmp_path / "examples").rglob(".*"))


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_a_comparison_is_resumed(number, dataset, tmp_path):
    words = comparing(dataset)
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    finish(words(whole))
    for files in (2, 7):
        check_end(number, *kill(words(killed), killed, number, files))
    finish(words(killed))
    same_comparison(whole, killed)


@pytest.mark.slow
def test_a_comparison_is_resumed_whenever_it_was_killed(dataset, tmp_path):
    kill_often(comparing(dataset), tmp_path / "whole", tmp_path / "killed", same_comparison)


def comparing(dataset: Path) -> Callable[[Path], list]:
    exposures = sorted(dataset.rglob("*.h5"))[:3]
    return lambda folder: ["compare", folder, *exposures, *COMPARE.split(), "--processes", 2]


def check_end(number, status, err):
    """One line and the status of an interruption; only SIGKILL leaves no time for them."""
    if number == signal.SIGKILL:
        assert status == -signal.SIGKILL
    else:
        assert (status, err) == (130, "pnpct: interrupted.\n")


@pytest.mark.parametrize("number", SIGNALS[:3])
def test_signals_that_end_do_what_ctrl_c_does(number, made, tmp_path, run, monkeypatch):
    before = signal.getsignal(number)
    monkeypatch.setattr("pnpct.cli.reconstruct.take_log", lambda _: os.kill(os.getpid(), number))
    status, _, err = run("reconstruct", made / "scan.h5", tmp_path / "out.h5")
    check_end(number, status, err)
    assert list(tmp_path.iterdir()) == []
    assert signal.getsignal(number) is before


@pytest.mark.parametrize("number", SIGNALS[:3])
def test_an_error_that_a_library_makes_of_a_signal_is_still_an_interruption(number, made, tmp_path, run, monkeypatch):
    """HDF5 does, in its lock: the file that was being read was called damaged."""

    def read(*_: object, **__: object) -> None:
        try:
            os.kill(os.getpid(), number)
            time.sleep(5)
        except KeyboardInterrupt as error:
            raise SystemError("returned a result with an exception set") from error

    monkeypatch.setattr("pnpct.files.hdf5.check_self_contained", read)
    status, _, err = run("reconstruct", made / "scan.h5", tmp_path / "out.h5")
    check_end(number, status, err)


def test_a_second_writer_of_a_data_set_is_told(tmp_path, run):
    from pnpct.files import sole_writer

    folder = tmp_path / "set"
    folder.mkdir()
    with sole_writer(folder):
        status, _, err = run("simulate", "dataset", folder, *DATASET.split(), "--processes", 1)
    assert status == 2
    assert "being written by another process" in err
    assert list(folder.iterdir()) == []
