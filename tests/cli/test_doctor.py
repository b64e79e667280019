"""What `pnpct doctor` says of this installation, and of its kernels in a new cache."""

import os
import re
import subprocess
import sys
from importlib.metadata import version

import pytest
import torch

from pnpct.simulation import clinical_fan_beam


def described(text: str) -> dict[str, str]:
    return dict(re.split(" +", line, maxsplit=1) for line in text.replace("on cpu", "cpu").splitlines())


def test_the_installation_is_described_a_line_for_each_thing(run, monkeypatch):
    monkeypatch.setattr("torch.cuda.is_available", lambda: False)
    monkeypatch.setattr("pnpct.cli.doctor.clinical_fan_beam", lambda: clinical_fan_beam(views=24, bins=32))
    status, out, err = run("doctor")
    assert (status, err) == (0, "")
    about = described(out)
    assert list(about) == [
        *("pnpct", "Python", "libraries", "processor", "threads"),
        *("CUDA", "temporary", "kernels", "cpu"),
    ]
    assert about["pnpct"].startswith(version("pnpct"))
    assert about["Python"].startswith(".".join(map(str, sys.version_info[:3])))
    assert all(f"{name} {version(name)}" in about["libraries"] for name in ("torch", "numba"))
    assert int(about["threads"]) == torch.get_num_threads()
    assert about["CUDA"].startswith("no device; PyTorch is built ")
    later, first = map(float, re.findall(r"[\d.]+(?= s\b)", about["cpu"]))
    assert 0 < later < first + 0.1


@pytest.mark.slow
def test_kernels_are_compiled_once_and_then_loaded(tmp_path):
    kernels = []
    for _ in range(2):
        program = [sys.executable, "-m", "pnpct", "doctor"]
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
        done = subprocess.run(program, env=environment, capture_output=True, text=True, check=True)
        kernels.append(described(done.stdout)["kernels"])
    assert kernels[0].startswith("compiled now; later runs load them from " + str(tmp_path))
    assert kernels[1].startswith("loaded from " + str(tmp_path))
