"""Small scans and images, made once by the commands themselves."""

import json
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from pnpct.cli import main

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture(scope="session")
def made(tmp_path_factory) -> Path:
    """A folder with a simulated scan, its FBP image, and the same scan as arrays of numpy."""
    folder = tmp_path_factory.mktemp("made")
    scan, image = folder / "scan.h5", folder / "image.h5"
    words = "--anatomy head --size 64 --views 60 --bins 100"
    assert main(["simulate", "scan", str(scan), *words.split()]) == 0
    assert main(["reconstruct", str(scan), str(image), "--method", "fbp"]) == 0
    with h5py.File(scan) as file:
        np.save(folder / "counts.npy", file["counts"][()])
        np.save(folder / "incident.npy", file["incident"][()])
        np.save(folder / "correction.npy", file["beam_hardening/coefficients"][()])
    (folder / "geometry.json").write_text(json.dumps(GEOMETRY))
    return folder


GEOMETRY = {
    "source_to_isocenter_mm": 541,
    "source_to_detector_mm": 949,
    "bins": 100,
    "bin_width_mm": 1.0239 * 9,
    "detector_offset_bins": 0.25,
    "views": 60,
}


@pytest.fixture
def run(capsys) -> Run:
    """Run the program in this process; return its exit status and what it wrote to stdout and stderr."""

    def run(*words: object) -> tuple[int, str, str]:
        capsys.readouterr()
        status = main([str(word) for word in words])
        written = capsys.readouterr()
        return status, written.out, written.err

    return run


@pytest.fixture
def full_disk():
    """A disk on which no file can grow beyond 10 kB."""
    resource = pytest.importorskip("resource", reason="this system has no limits to set")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, limits[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, limits)
