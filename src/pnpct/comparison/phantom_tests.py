"""What phantoms say of the methods: noise power, sharpness, and how well faint inserts are found at each dose."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Literal

import numpy as np
import torch
from numpy.typing import NDArray

from pnpct.arrays import Image
from pnpct.comparison.candidates import Candidate
from pnpct.comparison.results import Curve, DosePoint, DoseShare, Task
from pnpct.evaluation import (
    InsertDetectability,
    InsertScans,
    Interval,
    best_references,
    detectability_by_dose,
    dose_curves,
    equal_detectability_dose,
    noise_power_of_repeats,
    task_transfer,
)
from pnpct.geometry import ImageGrid
from pnpct.operators import Projector
from pnpct.physics import Exposure, Sinogram, take_log
from pnpct.simulation import (
    Insert,
    as_exposure,
    clinical_fan_beam,
    low_contrast_phantom,
    scanner_beam,
    simulate_moments,
)

GRID = ImageGrid(256, 256, spacing=0.9)
"""Of all images; the phantom has 200 mm."""

INSERTS = (
    Insert(diameter=6.0, contrast_hu=-40.0, center=(40.0, 40.0)),
    Insert(diameter=8.0, contrast_hu=-30.0, center=(-40.0, 40.0)),
    Insert(diameter=10.0, contrast_hu=-20.0, center=(-40.0, -40.0)),
    Insert(diameter=14.0, contrast_hu=-15.0, center=(40.0, -40.0)),
)
"""Dark, as liver lesions are."""

EDGE = Insert(diameter=30.0, contrast_hu=-120.0, center=(0.0, 0.0))
"""The disc whose edge shows how sharp a method is."""


def phantom_exposure(inserts: Sequence[Insert], *, tube_voltage_kvp: float) -> Exposure:
    """Return the exposure of 200 mm of water with inserts."""
    geometry = clinical_fan_beam()
    beam = scanner_beam(geometry, tube_voltage_kvp=tube_voltage_kvp)
    fine = ImageGrid(2 * GRID.rows, 2 * GRID.cols, GRID.spacing / 2)
    phantom = low_contrast_phantom(fine, inserts=inserts, energy=beam.effective_energy)
    (moments,) = simulate_moments(phantom, geometry, [beam])
    return as_exposure(moments, geometry, beam)


def phantom_curves(
    candidates: Sequence[Candidate], *, tube_current_ma: float, tube_voltage_kvp: float, repeats: int, seed: int
) -> Iterator[Curve]:
    """Yield noise power and transfer of each method.

    Args:
        candidates: The methods.
        tube_current_ma: Of the scans, mA.
        tube_voltage_kvp: Of the scans, kVp.
        repeats: Scans of each phantom, at least 2; fewer make rougher curves.
        seed: Of the noise.
    """
    water, disc = (phantom_exposure(inserts, tube_voltage_kvp=tube_voltage_kvp) for inserts in ((), (EDGE,)))
    A = Projector(GRID, water.geometry, mu_water=water.mu_water)
    scans = [_drawn(exposure, repeats, tube_current_ma, seed + number) for number, exposure in enumerate((water, disc))]
    for candidate in candidates:
        name = candidate.method.name
        images, edges = (candidate.make(scan, A) for scan in scans)
        middle = slice(GRID.rows // 2 - 64, GRID.rows // 2 + 64)
        power = noise_power_of_repeats(images[:, middle, middle], spacing=GRID.spacing).radial()
        where = f"200 mm of water, {tube_current_ma:g} mA, {tube_voltage_kvp:g} kVp"
        noise = float(images[:, middle, middle].double().std(dim=0).mean()) * 1000
        summary: dict[str, float | None] = {"mean_frequency_per_mm": power.mean_frequency, "noise_hu": noise}
        yield Curve("noise-power", name, where, _plain(power.frequencies), _plain(power.power), summary)
        found = task_transfer(
            edges, grid=GRID, center=EDGE.center, radius=EDGE.diameter / 2, least_contrast_to_noise=0.0
        )
        shown = found.frequencies <= 0.5 / GRID.spacing
        what = f"disc of {EDGE.contrast_hu:g} HU, {where}".replace("-", "−")
        summary = {"f50_per_mm": _finite(found.f50), "f10_per_mm": _finite(found.f10)}
        yield Curve("transfer", name, what, _plain(found.frequencies[shown]), _plain(found.transfer[shown]), summary)


def phantom_tasks(
    candidates: Sequence[Candidate],
    *,
    tube_currents_ma: Sequence[float],
    tube_voltage_kvp: float,
    pairs: int,
    seed: int,
) -> Iterator[Task]:
    """Yield for each method and insert how well it is found against dose, and the dose at which it is found as well.

    The mark is d′ of the first candidate, FBP, at the highest tube current.

    Raises:
        ValueError: If there are fewer than four tube currents, or too few pairs.
    """
    present, absent = (phantom_exposure(inserts, tube_voltage_kvp=tube_voltage_kvp) for inserts in (INSERTS, ()))
    scans = InsertScans(present, absent, INSERTS, GRID)
    A = Projector(GRID, present.geometry, mu_water=present.mu_water)
    full = max(tube_currents_ma)
    mark: dict[Insert, Interval] = {}
    for candidate in candidates:
        found = list(
            detectability_by_dose(
                partial(_with_projector, candidate, A),
                scans,
                tube_currents_ma=sorted(tube_currents_ma),
                generator=torch.Generator().manual_seed(seed),
                pairs=pairs,
                batch=8,
            )
        )
        curves = dose_curves(found)
        mark = mark or best_references(curves, full_dose=full)
        for insert, curve in curves.items():
            equal = equal_detectability_dose(curve, mark[insert], full_dose=full, generator=np.random.default_rng(seed))
            share = None if equal.outside else equal.fraction.estimate
            reference = f"{candidates[0].method.label} at {full:g} mA"
            yield _task(
                candidate,
                "channelised Hotelling",
                insert,
                found,
                DoseShare(reference, share, equal.fraction.low, equal.fraction.high),
            )
        if candidate.method.kind in ("fbp", "control"):
            for insert in INSERTS:
                yield _task(candidate, "NPWE", insert, found, None)


def _task(
    candidate: Candidate,
    observer: Literal["channelised Hotelling", "NPWE"],
    insert: Insert,
    found: Sequence[InsertDetectability],
    equal: DoseShare | None,
) -> Task:
    points = []
    for record in found:
        if record.insert == insert:
            judged = record.hotelling if observer == "channelised Hotelling" else record.npwe
            d = judged.d_prime
            points.append(DosePoint(record.tube_current_ma, d.estimate, d.low, d.high, judged.auc))
    words = f"{insert.diameter:g} mm, {insert.contrast_hu:+g} HU".replace("-", "−")
    return Task(candidate.method.name, observer, words, tuple(points), equal)


def _with_projector(candidate: Candidate, A: Projector, sinogram: Sinogram) -> Image:
    return candidate.make(sinogram, A)


def _drawn(exposure: Exposure, repeats: int, tube_current_ma: float, seed: int) -> Sinogram:
    generator = torch.Generator().manual_seed(seed)
    scans = [exposure.scan(tube_current_ma=tube_current_ma, generator=generator) for _ in range(repeats)]
    return take_log(replace(scans[0], counts=torch.stack([scan.counts for scan in scans])))


def _plain(values: NDArray[np.float64]) -> tuple[float, ...]:
    return tuple(float(value) for value in values)


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None
