"""What a command loads before it begins: it must not wait for libraries that it does not use."""

import os
import platform
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
    *("scipy.fft", "scipy.interpolate", "scipy.ndimage", "scipy.sparse", "scipy.stats", "sympy", "triton"),
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


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only the GNU C library gives memory back at once")
def test_memory_that_arrays_leave_is_kept():
    program = """
import resource
from pnpct.cli import main

def faults():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    b"x" * (1 << 26)
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

faults()
before = faults()
main(["--version"])
faults()
print(before, faults())
"""
    unset = {name: value for name, value in os.environ.items() if not name.startswith("MALLOC_")}
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, env=unset)
    before, after = map(int, done.stdout.splitlines()[-1].split())
    assert before > 1000
    assert after < before / 10
