"""Check shapes and types of every call while tests run; numba compiles its kernels from the bare functions."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from jaxtyping import install_import_hook

SOURCE = Path(__file__).parent / "src"

install_import_hook(
    [
        ".".join(path.relative_to(SOURCE).with_suffix("").parts)
        for path in SOURCE.rglob("*.py")
        # Anatomy is made of thousands of small functions, each of which would be wrapped anew when it is made.
        if not path.stem.endswith("_kernels") and path.stem not in {"__init__", "vector_ir"}
        if path.parent.name != "anatomy"
    ],
    "beartype.beartype(conf=beartype.BeartypeConf(is_pep484_tower=True))",
)


@pytest.fixture(autouse=True)
def example_scan(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """The README reads a scan: give it a small one, in a folder of its own."""
    if not (isinstance(request.node, pytest.DoctestItem) and request.path.name == "README.md"):
        yield
        return
    from pnpct.cli import main

    here, folder = Path.cwd(), tmp_path_factory.mktemp("readme")
    os.chdir(folder)
    assert (
        main([*["simulate", "scan", "scan.h5", "--anatomy", "head", "--size", "32", "--views", "48", "--bins", "60"]])
        == 0
    )
    yield
    os.chdir(here)
