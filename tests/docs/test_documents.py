"""What the documents promise beside their Python examples, which pytest runs as doctests: names, links, commands."""

import json
import re
import shlex
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from pkgutil import resolve_name

import numpy as np
import pytest
from ct_pd_views import write_folder
from PIL import Image as Picture

from pnpct.cli import main
from pnpct.files import read_image
from pnpct.simulation import clinical_fan_beam

ROOT = Path(__file__).parents[2]
DOCUMENTS = {str(path.relative_to(ROOT)): path for path in sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")])}
QUICK = "--iterations 1 --tv-strength 0 --lesion-hu 0 --phantom-repeats 0 --processes 1"
SMALL = {
    "simulate scan": "--size 64 --views 48 --bins 60",
    "simulate dataset patients": "--size 32 --views 48 --bins 60 --tube-voltages-kvp 120 --processes 1",
    "simulate dataset training": "--size 64 --views 48 --bins 60 --cases 1 --tube-voltages-kvp 100 --processes 1",
    "simulate dataset": "--size 64 --views 48 --bins 60 --processes 1",
    "reconstruct patient.h5": "--iterations 2 --size 32",
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
    lines = [line for block in blocks for line in block.splitlines() if line.startswith("pnpct ")]
    return [line for line in lines if not line.startswith("pnpct demo")]  # `make demo` runs it


def links(document):
    """Text and target of each link within the project."""
    found = re.findall(r"\[([^\[\]]*)\]\(([^)\s]+)\)", DOCUMENTS[document].read_text())
    return [(text, link) for text, link in found if not link.startswith("https://")]


def anchors(page):
    """What links call the headings of a page; of equal ones the later are numbered."""
    text = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.DOTALL | re.MULTILINE)
    found = []
    for heading in re.findall(r"^#+ (.*)$", text, re.MULTILINE):
        name = re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")
        count = found.count(name)
        found.append(f"{name}-{count}" if count else name)
    return found


@pytest.mark.parametrize("document", DOCUMENTS)
def test_every_name_in_a_document_exists(document):
    for name in re.findall(r"`(pnpct(?:\.\w+)+)", DOCUMENTS[document].read_text()):
        assert resolve_name(name) is not None


@pytest.mark.parametrize("document", DOCUMENTS)
def test_every_link_within_the_project_leads_somewhere(document):
    for text, link in links(document):
        name, _, anchor = link.partition("#")
        target = DOCUMENTS[document].parent / name if name else DOCUMENTS[document]
        assert target.exists(), link
        assert not anchor or anchor in anchors(target), link
        if text.startswith("`test_"):
            assert f"def {text.strip('`')}(" in target.read_text(), text


def test_anchors_are_those_of_the_headings(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("# One\n\n```sh\n# a comment\n```\n\n## 2. σ_v *and* `b/c`\n\n## One\n")
    assert anchors(page) == ["one", "2-σ_v-and-bc", "one-1"]


def test_all_asks_are_answered():
    rows = re.findall(
        r"^\| (\d+) \| .+ \| (\w+) \| .+ \| (.+) \|$", DOCUMENTS["docs/asks.md"].read_text(), re.MULTILINE
    )
    assert [int(number) for number, _, _ in rows] == list(range(1, 25))
    assert {answer for _, answer, _ in rows} <= {"yes", "partly", "no"}
    assert all("](" in shown for _, _, shown in rows)


def test_the_index_has_every_decision():
    pages = sorted(path.name for path in (ROOT / "docs/decisions").glob("[0-9]*.md"))
    assert [link for _, link in links("docs/decisions/README.md")] == pages


@pytest.mark.parametrize("document", DOCUMENTS)
def test_every_script_that_a_document_names_is_there(document):
    for name in re.findall(
        r"\b((?:benchmarks|docs|runs|src|tests)/[\w/]+\.(?:py|sh))", DOCUMENTS[document].read_text()
    ):
        assert (ROOT / name).is_file(), name


@pytest.mark.parametrize("document", [name for name in DOCUMENTS if command_lines(name)])
def test_the_commands_of_a_document_run_one_after_the_other(document, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("pnpct.cli.doctor.clinical_fan_beam", lambda: clinical_fan_beam(views=24, bins=32))
    geometry = {"source_to_isocenter_mm": 541, "source_to_detector_mm": 949, "bins": 60, "bin_width_mm": 15}
    Path("geometry.json").write_text(json.dumps({**geometry, "views": 48}))
    counts = np.full((48, 60), 4000.0)
    counts[:, 20:40] = 400.0
    np.save("counts.npy", counts)
    if "import dicom-ct-pd" in DOCUMENTS[document].read_text():
        write_folder(Path("views"), views=70, mode="FFSZ")
    for line in command_lines(document):
        words = shlex.split(line, comments=True)[1:]
        words = words[: words.index(">")] if ">" in words else words
        options = next((more for name, more in SMALL.items() if line.startswith(f"pnpct {name}")), "")
        options = options.replace("--iterations 2", "") if "fbp" in words else options
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
