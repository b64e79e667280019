"""What each method makes of the phantoms: measured in jobs side by side, and kept as JSON in the folder."""

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import torch
from numpy.typing import NDArray

from pnpct.arrays import Image
from pnpct.comparison.candidates import Candidate, filtered
from pnpct.comparison.phantom_tests import CURVES_MA, REFERENCE_KERNELS, PhantomTests
from pnpct.comparison.plan import Plan
from pnpct.comparison.results import Check, Curve
from pnpct.evaluation import (
    InsertDetectability,
    InsertScans,
    TaskTransfer,
    detectability_by_dose,
    noise_power_of_repeats,
    task_transfer,
)
from pnpct.files import atomic_path
from pnpct.operators import Kernel, Projector
from pnpct.operators.processes import side_by_side
from pnpct.physics import Exposure, Sinogram, take_log
from pnpct.reconstruction import FBP

FOLDER = "phantoms"
"""Folder of the records in that of the comparison."""

LEAST_CONTRAST_TO_NOISE = 15.0
"""Below it an edge says nothing of sharpness."""

BATCH = 8
"""Scans that are reconstructed together."""


@dataclass(frozen=True)
class PhantomRecord:
    """What one method made of the phantoms: curves, or how well it shows the inserts at one dose.

    Args:
        place: Of the method among `phantom_candidates`.
        curves: Noise power and transfer; none in a record of detectability.
        found: By insert; none in a record of curves, and none where no observer could be trained.
        checks: What could not be measured, and why.
    """

    place: int
    curves: tuple[Curve, ...] = ()
    found: tuple[InsertDetectability, ...] = ()
    checks: tuple[Check, ...] = ()


@dataclass(frozen=True)
class PhantomJob:
    """The work on one record.

    Args:
        plan: The methods and their settings.
        tests: The phantoms and their scans.
        place: Of the method among `phantom_candidates`.
        tube_current_ma: Dose at which inserts are looked for, mA; None measures curves.
        depends_on: All that the record depends on, as plain values; its file is named after them.
    """

    plan: Plan
    tests: PhantomTests
    place: int
    tube_current_ma: float | None
    depends_on: Mapping[str, Any]

    @property
    def file(self) -> str:
        """Path of the record from the comparison's folder."""
        words = msgspec.json.encode(self.depends_on, order="deterministic")
        return f"{FOLDER}/{hashlib.sha256(words).hexdigest()}.json"


def phantom_candidates(plan: Plan) -> tuple[Candidate, ...]:
    """Return the methods of a plan, and after them FBP with the kernels that set the mark and are not among them."""
    return (*plan.candidates(), *(filtered(FBP(kernel)) for kernel in _further_kernels(plan)))


def phantom_jobs(plan: Plan, tests: PhantomTests) -> tuple[PhantomJob, ...]:
    """Return the jobs, those of the slowest methods first, as methods stand in the plan.

    Raises:
        OSError: If a network cannot be read.
        ValueError: If a setting is out of its range.
    """
    if plan.seed < 0:
        raise ValueError(f"A seed is a whole number from 0, got {plan.seed}.")
    methods = [candidate.method for candidate in phantom_candidates(plan)]
    of_all = {"version": version("pnpct"), "seed": plan.seed, "tube_voltage_kvp": tests.tube_voltage_kvp}
    jobs = []
    for place, method in enumerate(methods):
        given: dict[str, Any] = {**of_all, "method": {"name": method.name, "settings": dict(method.settings)}}
        given["phantoms"] = asdict(tests.phantoms)
        if tests.repeats and place < len(methods) - len(_further_kernels(plan)):
            of_curves = {"repeats": tests.repeats, "tube_current_ma": CURVES_MA, "least": LEAST_CONTRAST_TO_NOISE}
            jobs.append(PhantomJob(plan, tests, place, None, {**given, **of_curves}))
        for current in tests.doses_ma if tests.pairs else ():
            of_pairs = {"pairs": tests.pairs, "tube_current_ma": current, "batch": BATCH}
            jobs.append(PhantomJob(plan, tests, place, current, {**given, **of_pairs}))
    return tuple(reversed(jobs))


def measure_phantoms(folder: Path, jobs: Sequence[PhantomJob], *, processes: int = 1) -> Iterator[PhantomRecord]:
    """Yield the record of each job when it is done; what an earlier run has measured is read.

    Args:
        folder: Of the comparison.
        jobs: The jobs.
        processes: Jobs that are worked on at the same time.

    Raises:
        OSError: If a file cannot be written, or a process dies.
        ValueError: If an image cannot be made, or the phantoms do not fit their images.
    """
    left = []
    for job in jobs:
        if (kept := _kept(folder / job.file, job)) is None:
            left.append(job)
        else:
            yield kept
    if min(processes, len(left)) <= 1:
        yield from (_measure(folder, job) for job in left)
        return
    calls = [(folder, job) for job in left]
    yield from side_by_side(_measure, calls, processes=min(processes, len(left)))


def _kept(path: Path, job: PhantomJob) -> PhantomRecord | None:
    try:
        return replace(msgspec.json.decode(path.read_bytes(), type=PhantomRecord), place=job.place)
    except (OSError, msgspec.MsgspecError):
        return None


def _further_kernels(plan: Plan) -> list[Kernel]:
    return [kernel for kernel in REFERENCE_KERNELS if kernel != plan.kernel]


def _measure(folder: Path, job: PhantomJob) -> PhantomRecord:
    candidate = phantom_candidates(job.plan)[job.place]
    record = _curves(job, candidate) if job.tube_current_ma is None else _found(job, candidate, job.tube_current_ma)
    path = folder / job.file
    path.parent.mkdir(parents=True, exist_ok=True)
    content = {**msgspec.to_builtins(record), "depends_on": msgspec.to_builtins(job.depends_on)}
    with atomic_path(path) as temporary:
        temporary.write_bytes(msgspec.json.format(msgspec.json.encode(content), indent=1) + b"\n")
    return record


def _found(job: PhantomJob, candidate: Candidate, tube_current_ma: float) -> PhantomRecord:
    tests, grid = job.tests, job.tests.phantoms.grid
    present, absent = tests.exposure(tests.phantoms.inserts), tests.exposure(())
    scans = InsertScans(present, absent, tests.phantoms.inserts, grid)
    A = Projector(grid, present.geometry, mu_water=present.mu_water)
    found: list[InsertDetectability] = []
    checks = []
    records = detectability_by_dose(
        partial(_with_projector, candidate, A),
        scans,
        tube_currents_ma=[tube_current_ma],
        generator=_generator(job.plan, f"{tube_current_ma!r} mA"),
        pairs=tests.pairs,
        batch=BATCH,
    )
    try:
        found.extend(records)
    except ValueError as error:  # images that are the same for all noise, or not finite
        says = f"At {tube_current_ma:g} mA no observer could be trained: {error}"
        checks.append(Check("detectability", None, candidate.method.name, None, None, None, "not judged", says))
    return PhantomRecord(job.place, found=tuple(found), checks=tuple(checks))


def _curves(job: PhantomJob, candidate: Candidate) -> PhantomRecord:
    tests, name = job.tests, candidate.method.name
    grid, edge = tests.phantoms.grid, tests.phantoms.edge
    water, disc = tests.exposure(()), tests.exposure((edge,))
    A = Projector(grid, water.geometry, mu_water=water.mu_water)
    images, edges = (
        candidate.make(_drawn(exposure, tests.repeats, _generator(job.plan, what)), A)
        for exposure, what in ((water, "water"), (disc, "edge"))
    )
    middle = images[:, grid.rows // 4 : -(grid.rows // 4), grid.cols // 4 : -(grid.cols // 4)]
    power = noise_power_of_repeats(middle, spacing=grid.spacing, size=tests.phantoms.patch).radial()
    noise = 1000 * float(middle.double().var(dim=0).mean().sqrt())
    where = f"{2 * tests.phantoms.radius:g} mm of water, {CURVES_MA:g} mA, {tests.tube_voltage_kvp:g} kVp"
    summary: dict[str, float | None] = {"mean_frequency_per_mm": _finite(power.mean_frequency), "noise_hu": noise}
    curves = [Curve("noise-power", name, where, _plain(power.frequencies), _plain(power.power), summary)]
    checks = []
    transfer, ratio = _transfer(edges, tests)
    if transfer is None:
        says = (
            f"The edge of a disc of {edge.contrast_hu:g} HU stands out too little from the noise of the averaged "
            f"images for a transfer function; more repeats of the phantoms are needed."
        ).replace("-", "−")
        limits = ratio, LEAST_CONTRAST_TO_NOISE, None
        checks.append(Check("contrast to noise of the edge", None, name, *limits, "not judged", says))
    else:
        shown = transfer.frequencies <= 0.5 / grid.spacing
        what = f"disc of {edge.contrast_hu:g} HU, {where}".replace("-", "−")
        summary = {"f50_per_mm": _finite(transfer.f50), "f10_per_mm": _finite(transfer.f10), "contrast_to_noise": ratio}
        values = _plain(transfer.frequencies[shown]), _plain(transfer.transfer[shown])
        curves.append(Curve("transfer", name, what, *values, summary))
    return PhantomRecord(job.place, tuple(curves), checks=tuple(checks))


def _transfer(edges: Image, tests: PhantomTests) -> tuple[TaskTransfer | None, float | None]:
    """The transfer function, None where noise would pass for sharpness; and the contrast-to-noise ratio."""
    phantoms = tests.phantoms
    grid, center, radius = phantoms.grid, phantoms.edge.center, phantoms.edge.diameter / 2
    try:
        found = task_transfer(edges, grid=grid, center=center, radius=radius, least_contrast_to_noise=0.0)
    except ValueError:  # there is no contrast at all
        return None, 0.0
    ratio = _finite(found.contrast_to_noise)
    return (None if found.contrast_to_noise < LEAST_CONTRAST_TO_NOISE else found), ratio


def _with_projector(candidate: Candidate, A: Projector, sinogram: Sinogram) -> Image:
    return candidate.make(sinogram, A)


def _drawn(exposure: Exposure, repeats: int, generator: torch.Generator) -> Sinogram:
    scans = [exposure.scan(tube_current_ma=CURVES_MA, generator=generator) for _ in range(repeats)]
    return take_log(replace(scans[0], counts=torch.stack([scan.counts for scan in scans])))


def _generator(plan: Plan, what: str) -> torch.Generator:
    """Methods share their scans; two doses or phantoms share no noise."""
    (seed,) = np.random.SeedSequence([plan.seed, *what.encode()]).generate_state(1, np.uint64)
    return torch.Generator().manual_seed(int(seed) % 2**63)


def _plain(values: NDArray[np.float64]) -> tuple[float, ...]:
    return tuple(float(value) for value in values)


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None
