"""Examples in a folder: drawn once, and never taken for others."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch
from safetensors import safe_open

from pnpct.training import CachedExamples, Examples, FBPImages, LoopImages


@pytest.fixture(scope="module")
def examples(dataset: Path) -> Examples:
    files = sorted(dataset.glob("train/*.h5"))
    return Examples(files, FBPImages(), (LoopImages(iterations=1),), seed=3, source="heads")


def test_a_cached_example_is_the_one_that_was_drawn(examples: Examples, tmp_path: Path) -> None:
    cached = CachedExamples(examples, tmp_path / "new")
    for _ in range(2):
        for name, tensor in vars(examples(1)).items():
            assert torch.equal(tensor, getattr(cached(1), name))
    (path,) = (tmp_path / "new").iterdir()
    assert path.name.startswith("000001-")


def test_a_file_states_all_that_the_example_depends_on(examples: Examples, tmp_path: Path) -> None:
    CachedExamples(examples, tmp_path)(0)
    (path,) = tmp_path.iterdir()
    with safe_open(path, "pt") as file:
        assert json.loads(file.metadata()["key"]) == {
            "format": "pnpct-example",
            "format_version": 4,
            "source": "heads",
            "files": [f"train/{file.name}" for file in examples.files],
            "images": [
                {"images": "fbp", "kernel": "ram-lak"},
                {
                    "images": "loop",
                    "denoiser": "tv",
                    "iterations": 1,
                    "number": 1,
                    "sigmas_v_hu": [40.0, 90.0],
                    "strengths_hu": [10.0, 60.0],
                    "tv_iterations": 20,
                },
            ],
            "references": None,
            "reference": 800.0,
            "tube_currents_ma": [20.0, 200.0],
            "seed": 3,
        }


@pytest.mark.parametrize(
    "change",
    [
        {"seed": 4},
        {"source": "other heads"},
        {"files": [Path("train/other.h5")]},
        {"make": FBPImages("soft")},
        {"others": ()},
        {"others": (LoopImages(iterations=2),)},
        {"make_references": (FBPImages(), LoopImages().undisturbed())},
        {"reference": 900.0},
        {"reference": "truth"},
        {"tube_currents_ma": (20.0, 100.0)},
    ],
    ids=str,
)
def test_every_setting_is_in_the_key(examples: Examples, tmp_path: Path, change: dict[str, Any]) -> None:
    assert CachedExamples(replace(examples, **change), tmp_path).key != CachedExamples(examples, tmp_path).key


def test_what_is_damaged_or_of_another_example_is_not_taken(examples: Examples, tmp_path: Path) -> None:
    cached, other = (CachedExamples(each, tmp_path) for each in (examples, replace(examples, seed=4)))
    cached(0)
    (path,) = tmp_path.iterdir()
    other(0)
    (another,) = set(tmp_path.iterdir()) - {path}
    another.write_bytes(path.read_bytes())
    with pytest.raises(OSError, match="is of an example with other settings; remove it"):
        other(0)
    path.write_bytes(path.read_bytes()[:100])
    with pytest.raises(OSError, match="damaged"):
        cached(0)
