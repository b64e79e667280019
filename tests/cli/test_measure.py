"""`pnpct measure`: from images of a phantom to a page of curves."""

import json
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

WORDS = "--uniform -6 0 8 --disc 6 0 8 --lesion 20 5"


@pytest.fixture(scope="module")
def phantom(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six slices of water with a rod along z."""
    path = tmp_path_factory.mktemp("phantom") / "phantom.npz"
    at = (np.arange(64) - 31.5) * 0.5
    rod = 300.0 * (np.hypot(at[None, :] - 6, at[:, None]) < 4)
    image_hu = rod + np.random.default_rng(0).normal(0, 8, (6, 64, 64))
    image_hu[:, :2] = -1000
    np.savez(path, hu=image_hu.astype(np.float32), z_mm=np.arange(6.0), spacing_mm=0.5)
    return path


def test_a_page_has_the_curves_and_numbers_that_are_printed_and_stored(phantom: Path, tmp_path: Path, run) -> None:
    page = tmp_path / "page.html"
    status, out, err = run("measure", phantom, page, *WORDS.split())
    assert (status, err) == (0, "")
    stored = json.loads((tmp_path / "page.html.json").read_text())["settings"]
    assert stored["numbers"]["noise_hu"] == pytest.approx(8, rel=0.1)
    assert stored["numbers"]["d_prime_npw"] > stored["numbers"]["d_prime_npwe"] > 0
    assert set(stored["curves"]) == {"noise_power_hu2_mm2", "transfer"}
    text = page.read_text(encoding="utf-8")
    HTMLParser().feed(text)
    assert text.count("<figure") == 2
    for name, value in stored["numbers"].items():
        assert name in out
        assert f"<td>{float('inf') if value is None else value:.4g}</td>" in text
    assert "http" not in text.replace("http://www.w3.org/", "").replace("http-equiv", "")


def test_without_a_disc_there_is_noise_power_alone(phantom: Path, tmp_path: Path, run) -> None:
    assert run("measure", phantom, tmp_path / "page.html", "--uniform", "-6", "0", "8")[0] == 0
    assert (tmp_path / "page.html").read_text(encoding="utf-8").count("<figure") == 1


@pytest.mark.parametrize(
    ("words", "names"),
    [
        ("page.html", "--uniform"),
        ("page.html --uniform 60 0 8", "must be in the image"),
        ("page.html --uniform -6 0 8 --lesion 20 5", "transfer of a disc"),
        ("page.html --uniform -6 0 8 --disc -6 0 8", "stronger insert"),
        ("page.html --uniform -6 0 8 --insert 6 0 8", "at least 40 pairs"),
        ("page.html --uniform -6 0 8 --insert 60 0 8", "must be in the image"),
        ("page.txt --uniform -6 0 8", ".html"),
    ],
)
def test_what_cannot_be_measured_is_one_sentence(phantom: Path, tmp_path: Path, run, words: str, names: str) -> None:
    page, *rest = words.split()
    status, _, err = run("measure", phantom, tmp_path / page, *rest)
    assert status == 2
    assert err.count("\n") == 1
    assert names in err
    assert not list(tmp_path.iterdir())
