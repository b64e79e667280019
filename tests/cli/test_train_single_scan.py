"""`pnpct train --method single-scan`, and what each method cannot learn from."""

import json
from pathlib import Path

import pytest

from pnpct.cli.grids import grid_for
from pnpct.files import load_network, read_scan, sha256_of

SINGLE = "--method single-scan --parts 2 --epochs 2 --pairs-per-epoch 2 --batch 2 --side 32"


@pytest.fixture(scope="module")
def scan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from pnpct.cli import main

    path = tmp_path_factory.mktemp("single") / "scan.h5"
    words = "--anatomy head --size 48 --views 60 --bins 100"
    assert main(["simulate", "scan", str(path), *words.split()]) == 0
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
    assert about["finest_pixel_mm"] == grid_for(scan, read_scan(scan).geometry, size=None, field_of_view=None).spacing
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
    ("words", "names"),
    [
        ("{scan}", "scan.h5 file folder single-scan"),
        ("{scan} --method supervised", "scan.h5 file folder single-scan"),
        ("{here} --method single-scan", "folder scan"),
        ("{here}/none.h5 --method single-scan", "none.h5"),
        ("{scan} --method single-scan --parts 1", "two parts 1"),
        ("{scan} --method single-scan --parts 3", "30 views 60"),
        ("{scan} --method single-scan --noise-input", "noise-conditioned single scan"),
        ("{scan} --method single-scan --parts 2 --side 99", "patch of 99 pixels"),
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
