"""The pictures of the gallery, and their scripts; they are made by `python docs/gallery/build.py`."""

import ast
import re
import runpy
import shutil
from pathlib import Path

import pytest
from PIL import Image as Picture

FOLDER = Path(__file__).parents[2] / "docs" / "gallery"
SCRIPTS = sorted(path for path in FOLDER.glob("*.py") if path.stem != "build")


def test_the_page_has_every_picture_with_its_script_and_what_it_says():
    page = (FOLDER / "README.md").read_text(encoding="utf-8")
    assert sorted(re.findall(r"!\[.*\]\((.*)\.png\)", page)) == [script.stem for script in SCRIPTS]
    for script in SCRIPTS:
        text = script.read_text(encoding="utf-8")
        assert f"]({script.name})" in page
        assert ast.get_docstring(ast.parse(text)) in page
        assert len(text.splitlines()) < 40


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_a_picture_is_small_enough_and_large_enough(script):
    picture = script.with_suffix(".png")
    assert picture.stat().st_size < 150_000
    with Picture.open(picture) as shown:
        assert shown.width >= 400


@pytest.mark.slow
@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_a_script_makes_its_picture(script, tmp_path):
    runpy.run_path(shutil.copy(script, tmp_path))
    with Picture.open(tmp_path / f"{script.stem}.png") as made, Picture.open(script.with_suffix(".png")) as shipped:
        assert made.size == shipped.size
