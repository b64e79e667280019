"""`pnpct compare`, from exposures to a page."""

import json
from pathlib import Path

import pytest
import torch

from pnpct.cli import main
from pnpct.denoisers import RDNCBAM, RDNSize
from pnpct.files import save_network

DATASET = "--anatomy head --cases 1 --rows 1 --views 40 --bins 64 --size 72 --tube-voltages-kvp 120 --processes 1"
QUICK = "--iterations 1 --tv-strength 0 --lesion-hu 0 --phantom-repeats 0 --processes 1"


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("compare")
    assert main(["simulate", "dataset", str(folder / "set"), *DATASET.split()]) == 0
    (exposures,) = (folder / "set").rglob("*.h5")
    network = folder / "tiny.safetensors"
    about = {"command": [], "licence": "Apache-2.0", "manifest_sha256": "0" * 64, "metrics": {}, "seed": 0}
    torch.manual_seed(1)
    save_network(network, RDNCBAM(RDNSize(features=4, growth=4, blocks=1, convolutions=2)), about=about)
    return {"exposures": exposures, "network": network}


MINE = """
from pnpct.denoisers import Gaussian
from pnpct.reconstruction import FBP, PlugAndPlay

mine = PlugAndPlay(Gaussian(0.5), iterations=1)

def several():
    return {"one": FBP("soft"), "other": lambda sinogram, A: FBP("ram-lak")(sinogram, A).image}
"""


def test_one_command_makes_all_images_numbers_and_the_page(
    files: dict[str, Path], tmp_path: Path, run, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "methods_of_mine.py").write_text(MINE)
    monkeypatch.chdir(tmp_path)
    mine = ["--method", "methods_of_mine:mine", "--method", "methods_of_mine:several", "--denoiser", "gaussian"]
    networks = ["--supervised", files["network"], "--two-stage", files["network"]]
    folder = tmp_path / "out"
    words = ["compare", folder, files["exposures"], "--tube-currents-ma", "50", *networks, *mine, *QUICK.split()]
    status, out, err = run(*words)
    assert (status, err) == (0, "")
    assert "report.html: 1 case, " in out
    written = {path.name for path in folder.iterdir()}
    assert {"images", "metrics.json", "metrics.csv", "report.html", "panel.png", "panel.svg"} <= written
    content = json.loads((folder / "metrics.json").read_text())
    assert content["provenance"]["command"] == ["pnpct", *map(str, words)]
    (case,) = content["cases"]
    assert case["tube_current_ma"] == 50.0
    assert content["curves"] == content["tasks"] == []
    assert content["lesions"] == {}
    own = {"pnp-gaussian": "swept", "mine": "swept", "one": "compared", "other": "compared"}
    assert {method["name"]: method["role"] for method in content["methods"][7:]} == own
    assert {*own} <= {*case["images"]}
    swept = {name for name, maps in case["maps"].items() if "difference_hu" in maps}
    assert swept == {"pnp-two-stage", "pnp-gaussian", "mine"}
    page = (folder / "report.html").read_bytes()
    (folder / "report.html").unlink()
    assert run("report", folder)[0] == 0
    assert (folder / "report.html").read_bytes() == page
    status, _, err = run(*words, "--processes", "2")
    assert (status, err.count("\n")) == (2, 1)
    assert '"other" cannot be given to other processes' in err


@pytest.mark.parametrize(
    ("words", "names"),
    [
        ("--tube-currents-ma 50", "leave out --tube-currents-ma."),
        ("--tube-voltage-kvp 100 --tube-currents-ma 50", "leave out --tube-currents-ma and --tube-voltage-kvp."),
    ],
)
def test_options_of_scans_that_are_drawn_are_refused_where_all_are_measured(
    files: dict[str, Path], made: Path, tmp_path: Path, run, words: str, names: str
) -> None:
    networks = ["--supervised", files["network"], "--two-stage", files["network"]]
    status, _, err = run("compare", tmp_path / "out", made / "scan.h5", *networks, *words.split())
    assert (status, err.count("\n")) == (2, 1)
    assert "All of these are scans, so none is drawn" in err
    assert names in err
    assert not (tmp_path / "out").exists()


def test_the_help_shows_at_which_doses_scans_are_drawn(run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    status, out, _ = run("compare", "--help")
    assert status == 0
    assert "(default: 40.0 70.0 100.0)" in out
    assert "(default: 120.0)" in out


@pytest.mark.parametrize(
    ("words", "names"),
    [
        ("--tube-voltage-kvp 80", "no exposure at 80 kVp"),
        ("--two-stage nothing", "nothing"),
        ("--denoiser nothing", "nothing"),
        ("--method nothing", "named like"),
        ("--method pnpct.reconstruction:nothing", "cannot be imported as a method"),
        ("--method pnpct.comparison:Study", "must be a method"),
        ("--blur-pixels -1", "-1"),
        ("--detectability-pairs 10", "needs 40 pairs of scans or more, or 0 for none: 10"),
        ("--phantom-repeats 1", "needs two repeats of the phantoms or more, or 0 for none: 1"),
        ("--detectability-pairs 40 --tube-currents-ma 200", "a tube current besides 20, 200, 400 mA"),
    ],
)
def test_what_cannot_be_is_one_sentence(files: dict[str, Path], tmp_path: Path, run, words: str, names: str) -> None:
    networks = ["--supervised", files["network"], "--two-stage", files["network"]]
    status, _, err = run("compare", tmp_path / "out", files["exposures"], *networks, *words.split())
    assert status == 2
    assert err.count("\n") == 1
    assert names in err
    assert not (tmp_path / "out").exists()
