"""What a command loads before it begins: it must not wait for libraries that it does not use."""

import subprocess
import sys

import pytest

UNUSED = {
    *(
        "gecatsim",
        "jinja2",
        "matplotlib",
        "msgspec",
        "nibabel",
        "onnx",
        "PIL",
        "pydicom",
        "rich",
        "skimage.restoration",
    ),
    *("scipy.fft", "scipy.interpolate", "scipy.ndimage", "scipy.sparse", "scipy.stats", "sympy"),
    *("xraydb", "pnpct.comparison", "pnpct.evaluation", "pnpct.report", "pnpct.simulation", "pnpct.training"),
}
"""What filtered back-projection of a slice needs nothing of; together they take longer than all that it does."""


def loaded(*words: str) -> set[str]:
    """The modules that are loaded when a command has ended."""
    program = (
        "import sys; from pnpct.cli import main; status = main(sys.argv[1:]); print(*sys.modules); sys.exit(status)"
    )
    done = subprocess.run([sys.executable, "-c", program, *words], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return set(done.stdout.splitlines()[-1].split())


def test_filtered_back_projection_loads_only_what_it_uses(made, tmp_path):
    modules = loaded("reconstruct", f"{made / 'scan.h5'}", f"{tmp_path / 'fbp.h5'}", "--method", "fbp")
    assert sorted(UNUSED & modules) == []
    assert "pnpct.files.scan_file" in modules


@pytest.mark.parametrize("words", [["--help"], ["simulate"], ["--version"]])
def test_the_list_of_commands_needs_no_library(words):
    assert {"numpy", "torch", "tyro"} & loaded(*words) == set()
