"""`pnpct doctor`: what this installation is, and how fast it projects."""

import os
import platform
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from time import perf_counter

import torch
from llvmlite import binding

import pnpct
from pnpct.cli.terminal import say, working
from pnpct.geometry import ImageGrid
from pnpct.operators import Projector
from pnpct.operators.strip_kernels import back_project, project
from pnpct.simulation import clinical_fan_beam

_LIBRARIES = ("torch", "numba", "numpy", "scipy")
_FEATURES = ("avx2", "avx512f", "fma", "neon")
"""Of the processor: those that the kernels gain from."""


@dataclass(frozen=True)
class Doctor:
    """Describe this installation: versions, processor, devices, compiled kernels, and the time of a projection.

    Include what it prints when you report a bug.
    """

    def run(self, command: Sequence[str]) -> None:  # noqa: ARG002 - no file is written that would record it
        """Describe the installation; a line shows when it is known, so that the last one says what failed."""
        _say("pnpct", f"{pnpct.__version__} in {Path(pnpct.__file__).parent}")
        _say("Python", f"{platform.python_version()} on {platform.platform()}")
        _say("libraries", ", ".join(f"{name} {version(name)}" for name in _LIBRARIES))
        features = binding.get_host_cpu_features()
        able = ", ".join(name for name in _FEATURES if features.get(name)) or "no AVX2"
        _say("processor", f"{binding.get_host_cpu_name()} with {able}; {os.cpu_count()} cores")
        _say("threads", f"{torch.get_num_threads()}")
        cuda, built = (
            torch.cuda.is_available(),
            f"for CUDA {torch.version.cuda}" if torch.version.cuda else "without CUDA",
        )
        _say("CUDA", f"{torch.cuda.get_device_name() if cuda else 'no device'}; PyTorch is built {built}")
        _say("temporary", tempfile.gettempdir())
        for device in ("cpu", "cuda") if cuda else ("cpu",):
            projector = Projector(ImageGrid(512, 512, spacing=0.9), clinical_fan_beam())
            image = torch.ones(512, 512, device=device)
            with working("Timing a projection"):
                first, later = _seconds(projector, image), min(_seconds(projector, image) for _ in range(3))
            if device == "cpu":
                compiled = any(kernel.stats.cache_misses for kernel in (project, back_project))
                how = "compiled now; later runs load them from" if compiled else "loaded from"
                _say("kernels", f"{how} {project.stats.cache_path}")
            _say(
                f"on {device}",
                f"projection and back-projection of 512 x 512 pixels and 984 x 900 rays: {later:.3f} s, "
                f"the first time {first:.1f} s",
            )


def _seconds(projector: Projector, image: torch.Tensor) -> float:
    begin = perf_counter()
    float(projector.adjoint(projector(image)).sum())  # a number is there when a GPU is done
    return perf_counter() - begin


def _say(name: str, value: str) -> None:
    say(f"{name:10} {value}")
