"""The scan that whole loops and data steps reconstruct, and how they are watched."""

import time
from bisect import bisect_left
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from contenders import Call, World
from pnpct.arrays import Image
from pnpct.denoisers import LearnedDenoiser
from pnpct.evaluation import rmse_hu, soft_tissue_mask
from pnpct.files import load_denoiser
from pnpct.operators import Projector
from pnpct.physics import DiagonalWeights, Scan, Sinogram, simulate_counts, take_log
from pnpct.reconstruction.fourier import fourier_preconditioner
from pnpct.reconstruction.iteration_schedule import falling
from pnpct.reconstruction.normal_equations import (
    INNER_ITERATIONS,
    NormalOperator,
    Operator,
    balanced_sigma_v,
    conjugate_gradient,
    penalty_of,
)
from pnpct.reconstruction.pnp_admm import SIGMA_V
from pnpct.reconstruction.starting import starting_state
from pnpct.simulation import procedural_patient, truth

ITERATIONS = 20
"""Most iterations that a peer has to come to the error of pnpct."""

EXACT_STEPS = 40
"""Steps after which a data step counts as solved."""


def write_scan(world: World, file: Path, *, quanta: float = 1.5e4) -> None:
    """Simulate a low-dose scan without hardening: a head where the field is small, else an abdomen.

    The object has pixels and cells of half the size, so that nobody's projector made the data.
    """
    source = procedural_patient("head" if world.field < 300 else "abdomen", np.random.default_rng(0))
    fine = world.grid.halved
    phantom = source.body.slice(source.height, fine)
    geometry = world.geometry("flat")
    cells = replace(geometry, bins=2 * geometry.bins, bin_width=geometry.bin_width / 2)
    transmitted = (-Projector(fine, cells)(truth(phantom, fine))).exp()
    exact = -transmitted.unflatten(-1, (-1, 2)).mean(-1).log()
    counts = simulate_counts(
        exact, torch.tensor(quanta), electronic_noise=5.0, generator=torch.Generator().manual_seed(0)
    )
    scan = Scan(counts, torch.tensor(quanta), 5.0, geometry=geometry, mu_water=Projector(fine, cells).mu_water)
    sinogram = take_log(scan)
    np.savez(
        file,
        line_integrals=sinogram.line_integrals.numpy(),
        weights=sinogram.weights.diagonal.numpy(),
        truth=truth(phantom, world.grid).numpy(),
    )


@dataclass(frozen=True, eq=False)
class Task:
    """A scan that was read, and what is the same for all contenders."""

    world: World
    sinogram: Sinogram
    truth: Image
    denoise: LearnedDenoiser

    @classmethod
    def read(cls, world: World, file: str) -> "Task":
        found = {name: torch.from_numpy(values) for name, values in np.load(file).items()}
        weights = DiagonalWeights(found["weights"], tuple(found["weights"].shape))
        denoise = load_denoiser("n2n")
        assert isinstance(denoise, LearnedDenoiser)
        return cls(world, Sinogram(found["line_integrals"], weights), found["truth"], denoise)

    @property
    def projector(self) -> Projector:
        return Projector(self.world.grid, self.world.geometry("flat"))

    def error(self, image: Image) -> float:
        return rmse_hu(image, self.truth, mask=soft_tissue_mask(self.truth))

    def begun(self) -> tuple[Projector, Image, Iterator[Tensor]]:
        """Return the projector, the image to begin from, and the sigma_v of the iterations, as `PlugAndPlay` has."""
        A = self.projector
        start = starting_state(self.sinogram, A).v
        return A, start, falling(balanced_sigma_v(self.sinogram, A, start), SIGMA_V)


class Watch:
    """Time and error after each iteration; the time that looking takes is not counted.

    Args:
        patience: Seconds after which `look` says that it is enough.
    """

    def __init__(self, task: Task, patience: float) -> None:
        self._task, self._patience, self._began = task, patience, time.perf_counter()
        self.seconds: list[float] = []
        self.errors: list[float] = []

    def look(self, image: Image) -> bool:
        now = time.perf_counter()
        self.seconds.append(now - self._began)
        self.errors.append(self._task.error(image))
        self._began += time.perf_counter() - now
        return self.seconds[-1] > self._patience or len(self.seconds) >= ITERATIONS

    @property
    def record(self) -> dict[str, Any]:
        return {"seconds": self.seconds[-1], "after": self.seconds, "errors": self.errors}


@dataclass(frozen=True, eq=False)
class DataStep:
    """(AᵀWA + β) x = b, from v: the truth with 18 HU of white noise."""

    H: NormalOperator
    b: Image
    v: Image
    precondition: Operator
    exact: Image

    @classmethod
    def of(cls, task: Task) -> "DataStep":
        A, W, beta = task.projector, task.sinogram.weights, penalty_of(SIGMA_V).reshape(1, 1)
        v = task.truth + 0.018 * torch.randn(task.truth.shape, generator=torch.Generator().manual_seed(1))
        H, b = NormalOperator(A, W, beta), A.T(W(task.sinogram.line_integrals)) + beta * v
        precondition = fourier_preconditioner(task.sinogram, A)(beta)
        exact, _ = conjugate_gradient(H, b, v, H(v), iterations=EXACT_STEPS, precondition=precondition)
        return cls(H, b, v, precondition, exact)

    def solved(self, steps: int, precondition: Operator | None) -> Image:
        x, _ = conjugate_gradient(self.H, self.b, self.v, self.H(self.v), iterations=steps, precondition=precondition)
        return x

    def error(self, image: Image, exact: Image | None = None) -> float:
        return rmse_hu(image, self.exact if exact is None else exact)

    @cached_property
    def aim(self) -> float:
        """The error after the fewest steps that pnpct takes, preconditioned; HU."""
        return self.error(self.solved(INNER_ITERATIONS, self.precondition))

    @cached_property
    def plain_steps(self) -> int:
        """Plain steps that come as near."""
        return 1 + bisect_left(range(1, EXACT_STEPS), True, key=lambda n: self.error(self.solved(n, None)) <= self.aim)

    def timed(self, call: Callable[[], Image], steps: int, exact: Image | None = None) -> Call:
        def run() -> dict[str, Any]:
            began = time.perf_counter()
            x = call()
            return {"seconds": time.perf_counter() - began, "errors": [self.error(x, exact)], "steps": steps}

        return run
