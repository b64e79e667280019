import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FILES = [path.relative_to(ROOT) for folder in ("src", "tests") for path in sorted((ROOT / folder).rglob("*.py"))]


@pytest.mark.parametrize("file", FILES, ids=str)
def test_files_are_short(file: Path):
    assert len((ROOT / file).read_text().splitlines()) <= 300


@pytest.mark.parametrize("file", ["reconstruction/pnp_admm.py", "training/two_stage.py"])
def test_the_paper_is_a_file(file: str):
    assert len((ROOT / "src/pnpct" / file).read_text().splitlines()) <= 150


def test_the_package_imports_nothing_at_its_root():
    lines = (ROOT / "src/pnpct/__init__.py").read_text().splitlines()
    assert [line for line in lines if line.startswith(("import", "from"))] == ["from importlib.metadata import version"]


def test_mathematics_loads_no_file_formats_and_no_command_line():
    packages = ("geometry", "operators", "physics", "denoisers", "reconstruction", "evaluation")
    program = f"""
import sys
{"".join(f"import pnpct.{package};" for package in packages)}
print(*{{"h5py", "pydicom", "nibabel", "PIL", "rich", "tyro"}} & sys.modules.keys())
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
