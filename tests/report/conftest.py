"""A small comparison, and a browser if there is one."""

import shutil
from pathlib import Path

import pytest
from small_comparison import make_comparison

from pnpct.report import write_report


@pytest.fixture(scope="session")
def folder(tmp_path_factory) -> Path:
    """The folder of a comparison; tests that change it take a copy."""
    folder = tmp_path_factory.mktemp("comparison")
    make_comparison(folder)
    return folder


@pytest.fixture(scope="session")
def report(folder, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("report") / "report.html"
    write_report(folder, path)
    return path


@pytest.fixture
def own_folder(folder, tmp_path) -> Path:
    """A copy of the comparison that a test may change."""
    return Path(shutil.copytree(folder, tmp_path / "comparison"))
