"""The pages of the documentation site, without its generator: `make site` builds them, and checks their links."""

import ast
import inspect
import re
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from pkgutil import walk_packages

import pytest

import pnpct
from pnpct.cli.app import COMMANDS

ROOT = Path(__file__).parents[2]
SETTINGS = (ROOT / "mkdocs.yml").read_text()
PACKAGES = [found.name for found in walk_packages(pnpct.__path__, "pnpct.") if found.ispkg]


@pytest.fixture(scope="module")
def site():
    spec = spec_from_file_location("site_pages", ROOT / "docs/site_pages.py")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def pages(site):
    return site.reference_pages()


def names_on(page):
    return re.findall(r"^::: (?:\w+\.)+(\w+)$", page, re.MULTILINE)


@pytest.mark.parametrize("package", PACKAGES)
def test_every_public_name_is_on_its_reference_page_once(package, pages):
    public = getattr(import_module(package), "__all__", ())
    page = pages.get(f"docs/reference/{package.removeprefix('pnpct.')}.md", "")
    assert sorted(names_on(page)) == sorted(public)


def test_a_file_of_its_own_is_public_but_for_what_begins_with_an_underscore(pages):
    assert names_on(pages["docs/reference/units.md"]) == ["MU_WATER_70_KEV", "to_hu", "from_hu"]


def test_a_function_with_the_name_of_its_file_is_not_taken_for_the_file(pages):
    assert "\n::: pnpct.reconstruction.fbp.fbp\n" in pages["docs/reference/reconstruction.md"]


def test_a_public_name_has_an_assignment_of_its_own(site):
    """What reads the sources for the reference does not see a name among several on the left."""
    for package in PACKAGES:
        for origin, names in site.public_names(package).items():
            targets = [
                node.targets[0]
                for node in ast.parse(inspect.getsource(import_module(origin))).body
                if isinstance(node, ast.Assign)
            ]
            among = {name.id for each in targets if isinstance(each, ast.Tuple) for name in each.elts}
            assert not among.intersection(names), origin


def test_every_command_has_its_help(site):
    page = site.command_line_page()
    for command in COMMANDS:
        assert f"\n## pnpct {command}\n\n```text\nusage: pnpct {command} " in page
    assert page.count("\n```text\npositional arguments\n---") + page.count("\n```text\noptions\n---") == len(COMMANDS)


def test_the_navigation_has_every_page(site, pages):
    listed = re.findall(r"^ +- .*: (\S+\.(?:md|ipynb))$", SETTINGS, re.MULTILINE)
    written = [path.relative_to(ROOT).as_posix() for path in (*site.documents(), *site.notebooks())]
    assert sorted(listed) == sorted(
        [*pages, site.COMMAND_LINE, *(path for path in written if "/decisions/0" not in path)]
    )


def test_what_documents_link_to_is_on_the_site(site):
    linked = {path.relative_to(ROOT).as_posix() for path in site.linked_files()}
    assert {"docs/images/geometry.png", "runs/paper.sh", "tests/operators/test_projector.py"} <= linked


def test_lists_begin_after_an_empty_line(site):
    for path in site.documents():  # else the site has them in the paragraph above
        text = re.sub(r"^```.*?^```", "", path.read_text(), flags=re.DOTALL | re.MULTILINE)
        assert not re.findall(r"^(?![-|#] |\d+\. |\s).+\n(?:- |1\. ).*", text, re.MULTILINE), path
