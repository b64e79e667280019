"""What each method makes of the phantoms: measured side by side, and stored as JSON in the folder."""

import hashlib
from collections.abc import Generator, Sequence
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
from pnpct.comparison.methods import Candidate, Candidates, controls, unpacked
from pnpct.comparison.phantoms import CURVES_MA, Phantoms
from pnpct.comparison.schema import Check, Curve
from pnpct.comparison.study import Study
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

FOLDER = "phantoms"
"""Folder of the measurements in that of the comparison."""

REFERENCE_KERNELS: tuple[Kernel, ...] = ("ram-lak", "hann", "soft")
"""Kernels of FBP, the best of which sets the d′ to reach for each insert."""

LEAST_CONTRAST_TO_NOISE = 15.0
"""Below it an edge says nothing of sharpness."""

BATCH = 8
"""Scans that are reconstructed together."""


@dataclass(frozen=True)
class PhantomMeasurement:
    """What one method made of the phantoms: curves, or how well it shows the inserts at one dose.

    Args:
        method: Its name.
        curves: Noise power and transfer; none in a measurement of detectability.
        found: By insert; none in a measurement of curves, and none where no observer could be trained.
        checks: What could not be measured, and why.
    """

    method: str
    curves: tuple[Curve, ...] = ()
    found: tuple[InsertDetectability, ...] = ()
    checks: tuple[Check, ...] = ()


@dataclass(frozen=True)
class PhantomJob:
    """The work on one measurement.

    Args:
        method: The method.
        study: How the phantoms are scanned.
        tube_current_ma: Dose at which inserts are looked for, mA; None measures curves.
    """

    method: Candidate
    study: Study
    tube_current_ma: float | None

    @property
    def depends_on(self) -> dict[str, Any]:
        """All that the measurement depends on, as plain values."""
        study = self.study
        if self.tube_current_ma is None:
            scans = {"repeats": study.phantom_repeats, "tube_current_ma": CURVES_MA, "least": LEAST_CONTRAST_TO_NOISE}
        else:
            scans = {"pairs": study.detectability_pairs, "tube_current_ma": self.tube_current_ma, "batch": BATCH}
        method = {"name": self.method.name, "settings": dict(self.method.settings)}
        of_all = {"version": version("pnpct"), "seed": study.seed, "tube_voltage_kvp": study.tube_voltage_kvp}
        return {**of_all, "method": method, "phantoms": asdict(study.phantoms), **scans}

    @property
    def file(self) -> str:
        """Path of the measurement from the comparison's folder, named after all that it depends on."""
        words = msgspec.json.encode(self.depends_on, order="deterministic")
        return f"{FOLDER}/{hashlib.sha256(words).hexdigest()}.json"


def reference_kernels(methods: Candidates) -> tuple[Candidate, ...]:
    """Return FBP with each of the kernels that set the d′ to reach: the baseline, and what it has not."""
    baseline = methods.baseline
    further = (controls(kernel).baseline for kernel in REFERENCE_KERNELS)
    others = (each for each in further if each.method != baseline.method)
    return baseline, *(replace(each, name=f"{each.name}+{each.settings['kernel']}") for each in others)


def phantom_jobs(methods: Candidates, study: Study) -> tuple[PhantomJob, ...]:
    """Return the jobs, those of the methods that are shown last, which are the slowest, first."""
    jobs = [PhantomJob(method, study, None) for method in methods] if study.phantom_repeats else []
    if study.detectability_pairs:
        jobs += [
            PhantomJob(method, study, current)
            for method in (*methods, *reference_kernels(methods)[1:])
            for current in study.doses_ma
        ]
    return tuple(reversed(jobs))


def measure_phantoms(
    folder: Path, jobs: Sequence[PhantomJob], *, processes: int = 1, cluster: str | None = None
) -> Generator[PhantomMeasurement, None, None]:
    """Yield the measurement of each job when it is done; what an earlier run has measured is read.

    Args:
        folder: Of the comparison.
        jobs: The jobs.
        processes: Jobs that are worked on at the same time.
        cluster: Address of the scheduler of a Dask cluster, whose workers take the place of processes.

    Raises:
        OSError: If a file cannot be written, or a process dies.
        ValueError: If an image cannot be made, or the phantoms do not fit their images.
    """
    left = []
    for job in jobs:
        if (stored := _stored(folder / job.file)) is None:
            left.append(job)
        else:
            yield stored
    if not left or (processes == 1 and cluster is None):
        yield from (_measure(folder, job) for job in left)
        return
    calls = [(folder, job.method.packed(), job.study, job.tube_current_ma) for job in left]
    yield from side_by_side(_measure_packed, calls, processes=min(processes, len(left)), cluster=cluster)


def _stored(path: Path) -> PhantomMeasurement | None:
    try:
        return msgspec.json.decode(path.read_bytes(), type=PhantomMeasurement)
    except (OSError, RecursionError, ValueError):
        return None


def _measure_packed(folder: Path, method: bytes, study: Study, tube_current_ma: float | None) -> PhantomMeasurement:
    return _measure(folder, PhantomJob(unpacked(method), study, tube_current_ma))


def _measure(folder: Path, job: PhantomJob) -> PhantomMeasurement:
    found = _curves(job) if job.tube_current_ma is None else _detectability(job, job.tube_current_ma)
    path = folder / job.file
    path.parent.mkdir(parents=True, exist_ok=True)
    content = {**msgspec.to_builtins(found), "depends_on": msgspec.to_builtins(job.depends_on)}
    with atomic_path(path) as temporary:
        temporary.write_bytes(msgspec.json.format(msgspec.json.encode(content), indent=1) + b"\n")
    return found


def _detectability(job: PhantomJob, tube_current_ma: float) -> PhantomMeasurement:
    study, phantoms, name = job.study, job.study.phantoms, job.method.name
    present, absent = (phantoms.exposure(inserts, study.tube_voltage_kvp) for inserts in (phantoms.inserts, ()))
    A = Projector(phantoms.grid, present.geometry, mu_water=present.mu_water)
    found: list[InsertDetectability] = []
    records = detectability_by_dose(
        partial(_with_projector, job.method, A),
        InsertScans(present, absent, phantoms.inserts, phantoms.grid),
        tube_currents_ma=[tube_current_ma],
        generator=_generator(study, f"{tube_current_ma!r} mA"),
        pairs=study.detectability_pairs,
        batch=BATCH,
    )
    try:
        found.extend(records)
    except ValueError as error:  # images that are the same for all noise, or not finite
        says = f"At {tube_current_ma:g} mA no observer could be trained: {error}"
        check = Check("detectability", None, name, None, None, None, "not judged", says)
        return PhantomMeasurement(name, found=tuple(found), checks=(check,))
    return PhantomMeasurement(name, found=tuple(found))


def _curves(job: PhantomJob) -> PhantomMeasurement:
    study, phantoms, name = job.study, job.study.phantoms, job.method.name
    grid, edge, kvp = phantoms.grid, phantoms.edge, study.tube_voltage_kvp
    water, disc = phantoms.exposure((), kvp), phantoms.exposure((edge,), kvp)
    A = Projector(grid, water.geometry, mu_water=water.mu_water)
    images, edges = (
        job.method.make(_drawn(exposure, study.phantom_repeats, _generator(study, what)), A)
        for exposure, what in ((water, "water"), (disc, "edge"))
    )
    middle = images[:, grid.rows // 4 : -(grid.rows // 4), grid.cols // 4 : -(grid.cols // 4)]
    power = noise_power_of_repeats(middle, spacing=grid.spacing, size=phantoms.patch).radial()
    noise = 1000 * float(middle.double().var(dim=0).mean().sqrt())
    where = f"{2 * phantoms.radius:g} mm of water, {CURVES_MA:g} mA, {kvp:g} kVp"
    summary: dict[str, float | None] = {"mean_frequency_per_mm": _finite(power.mean_frequency), "noise_hu": noise}
    curves = [Curve("noise-power", name, where, _plain(power.frequencies), _plain(power.power), summary)]
    transfer, ratio = _transfer(edges, phantoms)
    if transfer is None:
        says = (
            f"The edge of a disc of {edge.contrast_hu:g} HU stands out too little from the noise of the averaged "
            f"images for a transfer function; more repeats of the phantoms are needed."
        ).replace("-", "−")
        limits = ratio, LEAST_CONTRAST_TO_NOISE, None
        check = Check("contrast to noise of the edge", None, name, *limits, "not judged", says)
        return PhantomMeasurement(name, tuple(curves), checks=(check,))
    shown = transfer.frequencies <= 0.5 / grid.spacing
    what = f"disc of {edge.contrast_hu:g} HU, {where}".replace("-", "−")
    summary = {"f50_per_mm": _finite(transfer.f50), "f10_per_mm": _finite(transfer.f10), "contrast_to_noise": ratio}
    values = _plain(transfer.frequencies[shown]), _plain(transfer.transfer[shown])
    return PhantomMeasurement(name, (*curves, Curve("transfer", name, what, *values, summary)))


def _transfer(edges: Image, phantoms: Phantoms) -> tuple[TaskTransfer | None, float | None]:
    """The transfer function, None where noise would pass for sharpness; and the contrast-to-noise ratio."""
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


def _generator(study: Study, what: str) -> torch.Generator:
    """Methods share their scans; two doses or phantoms share no noise."""
    (seed,) = np.random.SeedSequence([study.seed, *what.encode()]).generate_state(1, np.uint64)
    return torch.Generator().manual_seed(int(seed) % 2**63)


def _plain(values: NDArray[np.float64]) -> tuple[float, ...]:
    return tuple(float(value) for value in values)


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None
