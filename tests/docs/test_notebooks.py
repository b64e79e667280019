"""The notebooks, cell by cell as a notebook runs them, on smaller scans; `make site` runs them as they are."""

import ast
import json
import re
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "docs" / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
SCAN = re.compile(r'example_scan\("\w+", size=\d+, views=\d+, bins=\d+')


def cells(notebook, kind):
    return [cell for cell in json.loads(notebook.read_text(encoding="utf-8"))["cells"] if cell["cell_type"] == kind]


def run(source, names):
    """The value of the last line, which a notebook shows."""
    tree = ast.parse(source)
    if isinstance(last := tree.body[-1], ast.Expr):
        tree.body[-1] = ast.Assign([ast.Name("_", ast.Store())], last.value)
    names["_"] = None
    exec(compile(ast.fix_missing_locations(tree), "cell", "exec"), names)
    return names["_"]


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_every_cell_runs_and_what_it_shows_is_a_picture_or_short(notebook, capsys):
    names, pictures = {}, 0
    for cell in cells(notebook, "code"):
        shown = run(SCAN.sub('example_scan("head", size=24, views=48, bins=60', "".join(cell["source"])), names)
        pictures += hasattr(shown, "_repr_png_")
        assert len(repr(shown)) < 1000
    assert pictures
    assert "HU" in capsys.readouterr().out


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_no_output_is_stored_and_the_first_cell_has_the_title(notebook):
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in cells(notebook, "code"))
    assert "".join(cells(notebook, "markdown")[0]["source"]).startswith("# ")
