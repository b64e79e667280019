"""`pnpct train` on images of one's own patients, in DICOM and in other files."""

import json
from pathlib import Path

import numpy as np
import pytest
import torch

from pnpct.files import load_network, write_dicom_series
from pnpct.geometry import ImageGrid, VolumeGrid
from pnpct.units import from_hu

SHORT = "--epochs 2 --pairs-per-epoch 2 --batch 2 --side 16"


@pytest.fixture(scope="module")
def patients(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three patients, with series in DICOM at a quarter of the dose and at full dose."""
    folder = tmp_path_factory.mktemp("own") / "patients"
    draw = np.random.default_rng(0)
    grid = VolumeGrid(ImageGrid(24, 24, 1.0), 3, 1.0)
    for number in range(3):
        anatomy = torch.from_numpy(draw.uniform(-100, 100, (3, 1, 1)) + np.zeros((3, 24, 24)))
        for name, noise_hu in (("quarter", 40.0), ("full", 20.0)):
            (place := folder / f"L{number}" / name).parent.mkdir(parents=True, exist_ok=True)
            noisy = anatomy + torch.from_numpy(draw.normal(0, noise_hu, grid.shape))
            write_dicom_series(place, from_hu(noisy).float(), grid)
    return folder


def test_a_network_is_trained_on_pairs_of_series_and_says_of_whom(patients: Path, tmp_path: Path, run) -> None:
    path = tmp_path / "own.safetensors"
    words = ("--method", "image-pairs", "--low", "quarter", "--high", "full", "--validation", "L2", *SHORT.split())
    status, out, err = run("train", patients, path, *words)
    assert (status, err) == (0, "")
    assert [line.partition(": ")[0] for line in out.splitlines()[:2]] == ["supervised 1", "supervised 2"]
    assert all(" loss " in line and " images " in line for line in out.splitlines()[:2])
    load_network(path)
    about = json.loads((tmp_path / "own.safetensors.json").read_text())["about"]
    assert about["finest_pixel_mm"] == 1.0
    assert {split: len(prints) for split, prints in about["settings"]["patients"].items()} == {
        "train": 2,
        "validation": 1,
    }
    before = path.read_bytes()
    assert run("train", patients, path, *words)[0] == 0
    assert path.read_bytes() == before
    status, _, err = run("train", patients, path, *[word.replace("L2", "L1") for word in words])
    assert status == 2
    assert "other settings" in err
    assert "patients" in err


def test_a_network_is_trained_on_low_dose_series_alone(patients: Path, tmp_path: Path, run) -> None:
    path = tmp_path / "own.safetensors"
    words = ("--method", "neighbouring-slices", "--low", "quarter", *SHORT.split())
    status, out, err = run("train", patients, path, *words)
    assert (status, err) == (0, "")
    assert out.startswith("noise-to-noise 1: ")
    load_network(path)


@pytest.mark.parametrize(
    ("words", "names"),
    [
        ("{patients} --method image-pairs", "L0 low folder DICOM 0 times"),
        ("{patients} --method image-pairs --low quarter --high full --validation L9", "no patient L9"),
        ("{patients}/L0 --method neighbouring-slices", "L0 must hold low"),
        ("{here}/none --method image-pairs", "none no folder image-pairs"),
        ("{here} --method neighbouring-slices", "folder each of two or more patients holds 0"),
        ("{patients} --method neighbouring-slices --high full", "--high no effect image-pairs"),
        ("{patients} --low quarter", "--low no effect image-pairs or neighbouring-slices"),
        ("{patients} --method image-pairs --low quarter --high full --noise-input", "noise-conditioned"),
    ],
)
def test_what_cannot_be_learnt_from_is_one_sentence(
    patients: Path, tmp_path: Path, run, words: str, names: str
) -> None:
    data, *rest = words.format(patients=patients, here=tmp_path).split()
    status, _, err = run("train", data, tmp_path / "a.safetensors", *rest)
    assert status == 2
    assert err.count("\n") == 1
    missing = [name for name in names.split() if name not in err]
    assert not missing, err
    assert not list(tmp_path.iterdir())
