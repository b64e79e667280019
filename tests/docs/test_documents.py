"""What the documents promise beside their Python examples, which pytest runs as doctests: names, links, commands."""

import json
import re
import shlex
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from pkgutil import resolve_name

import numpy as np
import pytest
from PIL import Image as Picture

from pnpct.cli import main
from pnpct.files import read_image

ROOT = Path(__file__).parents[2]
DOCUMENTS = {str(path.relative_to(ROOT)): path for path in sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")])}
QUICK = "--iterations 1 --tv-strength 0 --lesion-hu 0 --phantom-repeats 0 --processes 1"
SMALL = {
    "simulate scan": "--size 64 --views 48 --bins 60",
    "simulate dataset patients": "--size 64 --views 48 --bins 60 --tube-voltages-kvp 120 --processes 1",
    "simulate dataset training": "--size 64 --views 48 --bins 60 --cases 1 --tube-voltages-kvp 100 --processes 1",
    "simulate dataset": "--size 64 --views 48 --bins 60 --processes 1",
    "reconstruct": "--iterations 2",
    "compare comparison patients": f"{QUICK} --tube-currents-ma 100",
    "compare mine": f"{QUICK} --tube-currents-ma 100",
    "compare": QUICK,
}


def script(name):
    spec = spec_from_file_location(name, ROOT / "docs" / "images" / f"{name}.py")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def command_lines(document):
    blocks = re.findall(r"^```sh\n(.*?)^```", DOCUMENTS[document].read_text(), re.DOTALL | re.MULTILINE)
    return [line for block in blocks for line in block.splitlines() if line.startswith("pnpct ")]


@pytest.mark.parametrize("document", DOCUMENTS)
def test_every_name_in_a_document_exists(document):
    for name in re.findall(r"`(pnpct(?:\.\w+)+)", DOCUMENTS[document].read_text()):
        assert resolve_name(name) is not None


@pytest.mark.parametrize("document", DOCUMENTS)
def test_every_link_within_the_project_leads_somewhere(document):
    path = DOCUMENTS[document]
    for target in re.findall(r"\]\(([^)#]+)", path.read_text()):
        assert target.startswith("https://") or (path.parent / target).exists(), target


@pytest.mark.parametrize("document", DOCUMENTS)
def test_every_script_that_a_document_names_is_there(document):
    for name in re.findall(
        r"\b((?:benchmarks|docs|runs|src|tests)/[\w/]+\.(?:py|sh))", DOCUMENTS[document].read_text()
    ):
        assert (ROOT / name).is_file(), name


@pytest.mark.parametrize("document", [name for name in DOCUMENTS if command_lines(name)])
def test_the_commands_of_a_document_run_one_after_the_other(document, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    geometry = {"source_to_isocenter_mm": 541, "source_to_detector_mm": 949, "bins": 60, "bin_width_mm": 15}
    Path("geometry.json").write_text(json.dumps({**geometry, "views": 48}))
    counts = np.full((48, 60), 4000.0)
    counts[:, 20:40] = 400.0
    np.save("counts.npy", counts)
    for line in command_lines(document):
        words = shlex.split(line, comments=True)[1:]
        options = next((more for name, more in SMALL.items() if line.startswith(f"pnpct {name}")), "")
        options = options if "fbp" not in words else ""
        assert main([*words, *options.split()]) == 0, f"{line}: {capsys.readouterr().err}"
    for image in Path().glob("*.nii.gz"):
        assert read_image(image)[0].isfinite().all()


def test_the_pictures_are_small():
    pictures = list((ROOT / "docs" / "images").glob("*.png"))
    assert pictures
    for picture in pictures:
        assert picture.stat().st_size < 300_000


def test_the_picture_of_the_chest_can_be_drawn(tmp_path):
    chest = script("make_chest")
    images = chest.reconstructions(size=48, views=60, bins=75)
    chest.draw(images, tmp_path / "chest.png")
    with Picture.open(tmp_path / "chest.png") as picture:
        assert picture.width == 3 * chest.WIDTH


def test_the_picture_of_the_geometry_can_be_drawn(tmp_path):
    script("make_geometry").main(tmp_path / "geometry.png")
    with Picture.open(tmp_path / "geometry.png") as picture, Picture.open(ROOT / "docs/images/geometry.png") as shipped:
        assert picture.size == shipped.size
