"""One case of a comparison: its images by every method, and what was measured of them."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

import torch

from pnpct.arrays import Image
from pnpct.comparison.candidates import Candidate
from pnpct.comparison.honesty import Evidence, judge, lesions, sweep
from pnpct.comparison.measures import Values, fidelity_values, histogram_values
from pnpct.comparison.plan import Plan
from pnpct.comparison.results import Case, Check, Detail, Grid, LesionResult, StoredImage
from pnpct.comparison.stored_images import ImageFolder
from pnpct.comparison.subjects import LoadedSubject, Subject
from pnpct.evaluation import (
    GLCMSpec,
    Texture,
    body_mask,
    repeat_scan_floor,
    texture_features,
    texture_patches,
)
from pnpct.files import sha256_of
from pnpct.geometry import FanBeam
from pnpct.operators import Projector
from pnpct.physics import take_log


@dataclass(frozen=True)
class CaseResults:
    """All of one case.

    Args:
        case: The case, with its images.
        patient: Whose slice it is.
        fidelity: Errors by method.
        texture: Texture by method, and of the reference; empty where no soft tissue was found to measure it on.
        histogram: Distances of histograms by method, and the floor of the reference.
        lesions: What became of a lesion.
        checks: Honesty checks.
    """

    case: Case
    patient: str
    fidelity: Mapping[str, Mapping[str, float | None]]
    texture: Mapping[str, Texture]
    histogram: Mapping[str, Mapping[str, float | None]]
    lesions: tuple[LesionResult, ...]
    checks: tuple[Check, ...]


def compare_case(folder: Path, subject: Subject, plan: Plan) -> CaseResults:
    """Reconstruct one scan by all methods, keep the images, and measure them.

    Raises:
        OSError: If a file cannot be read or written.
        ValueError: If the scan or a setting is not what it should be.
    """
    candidates, loaded = plan.candidates(), subject.load()
    A = Projector(loaded.grid, loaded.scan.geometry, mu_water=loaded.scan.mu_water)
    sinogram = take_log(loaded.scan)
    origin = {"scan": {**asdict(subject), "file": sha256_of(subject.file)}}
    kept = ImageFolder(folder, f"images/{subject.name}", loaded.grid, origin)
    files: dict[str, StoredImage] = {}
    images: dict[str, Image] = {}
    for candidate in candidates:
        name = candidate.method.name
        images[name], files[name] = kept.keep(name, partial(candidate.make, sinogram, A), candidate.method.settings)
    fbp, repeats = candidates[0], []
    for name, scan in zip(("reference", "reference-repeat"), loaded.references, strict=False):
        image, file = kept.keep(name, partial(fbp.make, take_log(scan), A), fbp.method.settings)
        repeats.append(image)
        files.setdefault("reference", file)
    if (truth := loaded.truth) is not None:
        _, files["truth"] = kept.keep("truth", lambda: truth, {})
    evidence = Evidence(subject.name, sinogram, A, truth, plan, kept)
    maps, checks = judge(evidence, images)
    last = candidates[-1].method.name
    case = Case(
        subject.name,
        subject.label,
        subject.tube_current_ma,
        subject.tube_voltage_kvp,
        Grid(loaded.grid.rows, loaded.grid.cols, loaded.grid.spacing, loaded.grid.center),
        _in_words(loaded.scan.geometry),
        _details(loaded, images[fbp.method.name]),
        files,
        maps,
        None if subject.tube_current_ma is None else subject.seed,
    )
    return CaseResults(
        case,
        subject.patient,
        _fidelity(images, loaded, repeats),
        _textures(images, loaded, repeats, fbp),
        _histograms(images, loaded, repeats),
        lesions(evidence, images, candidates),
        (*checks, sweep(evidence, images[last])),
    )


def _target(loaded: LoadedSubject, repeats: Sequence[Image]) -> Image | None:
    return loaded.truth if loaded.truth is not None else repeats[0] if repeats else None


def _fidelity(images: Mapping[str, Image], loaded: LoadedSubject, repeats: Sequence[Image]) -> dict[str, Values]:
    """Errors against the truth; the reference has its own."""
    if (truth := _target(loaded, repeats)) is None:
        return {}
    compared = {**images, **({"reference": repeats[0]} if repeats and loaded.truth is not None else {})}
    return {name: fidelity_values(image, truth) for name, image in compared.items()}


def _textures(
    images: Mapping[str, Image], loaded: LoadedSubject, repeats: Sequence[Image], fbp: Candidate
) -> dict[str, Texture]:
    """Texture on patches that the reference alone has chosen; where the truth is known it is the reference."""
    target = _target(loaded, repeats)
    chosen_on = images[fbp.method.name] if target is None else target
    spec = GLCMSpec()
    if min(chosen_on.shape) < spec.patch:
        return {}
    patches = texture_patches(chosen_on, spec=replace(spec, smoothing=0.0 if loaded.truth is not None else 4.0))
    if not patches:
        return {}
    measured = {**images, **({} if target is None else {"reference": target})}
    return {name: texture_features(image, patches, spec=spec) for name, image in measured.items()}


def _histograms(images: Mapping[str, Image], loaded: LoadedSubject, repeats: Sequence[Image]) -> dict[str, Values]:
    if (target := _target(loaded, repeats)) is None:
        return {}
    found = {name: histogram_values(image, target) for name, image in images.items()}
    if len(repeats) == 2:
        floor = repeat_scan_floor(torch.stack(list(repeats)), mask=body_mask(target))
        found["reference"] = {"repeat_scan_floor": floor}
    return found


def _details(loaded: LoadedSubject, fbp: Image) -> tuple[Detail, ...]:
    """Two squares within the body, chosen by where it is, not by what any method has made of it."""
    rows, cols = torch.nonzero(body_mask(fbp if loaded.truth is None else loaded.truth), as_tuple=True)
    if not len(rows):
        return ()
    size = max(8, min(fbp.shape) // 5)

    def around(row: float, col: float) -> Detail:
        first_row, first_col = (
            int(min(max(at - size / 2, 0), whole - size)) for at, whole in zip((row, col), fbp.shape, strict=True)
        )
        return Detail(first_row, first_col, size)

    top, bottom = (float(torch.quantile(rows.double()[:: 1 + len(rows) // 10**6], q)) for q in (0.25, 0.75))
    left, right = (float(torch.quantile(cols.double()[:: 1 + len(cols) // 10**6], q)) for q in (0.3, 0.65))
    return around(top, left), around(bottom, right)


def _in_words(geometry: FanBeam) -> str:
    return f"{geometry.views} views of {geometry.bins} bins, {geometry.detector} detector"
