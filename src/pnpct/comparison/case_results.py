"""One case of a comparison: its images by every method, and what was measured of them."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import torch

from pnpct.arrays import Image
from pnpct.comparison.candidates import Candidate
from pnpct.comparison.case_record import Case, Detail, Grid, StoredImage
from pnpct.comparison.honesty import Evidence, cross_view, judge, sweep
from pnpct.comparison.measures import Values, fidelity_values, histogram_values
from pnpct.comparison.outcomes import errors_against_fbp, lesions
from pnpct.comparison.plan import Plan
from pnpct.comparison.results import Check, LesionResult
from pnpct.comparison.stored_images import ImageFolder
from pnpct.comparison.subjects import LoadedSubject, Subject
from pnpct.evaluation import (
    GLCMSpec,
    Texture,
    repeat_scan_floor,
    texture_features,
    texture_patches,
)
from pnpct.files import sha256_of
from pnpct.operators import Projector
from pnpct.physics import take_log


@dataclass(frozen=True)
class CaseResults:
    """All of one case.

    Args:
        case: The case, with its images.
        patient: Whose slice it is.
        fidelity: Errors by method.
        texture: Texture by method, and of "reference", "repeat" and "truth"; empty where there is no soft tissue.
        histogram: Distances of histograms by the same names, and the floor of the reference.
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
    given, files_given = _given(loaded, kept, candidates[0], A)
    evidence = Evidence(subject.name, sinogram, A, loaded.truth, images[candidates[0].method.name], plan, kept)
    maps, checks = judge(evidence, images)
    swept, of_sweep = sweep(evidence, images[candidates[-1].method.name])
    for name, one in swept.items():
        maps[name] |= one
    inserted, of_lesions = lesions(evidence, images, candidates)
    textures = _textures(images, given, evidence)
    of_texture = next(iter(textures.values()), None)
    case = Case(
        subject.name,
        subject.label,
        subject.tube_current_ma,
        subject.tube_voltage_kvp,
        Grid(loaded.grid.rows, loaded.grid.cols, loaded.grid.spacing, loaded.grid.center),
        str(loaded.scan.geometry),
        _details(evidence),
        {**files, **files_given},
        maps,
        None if subject.tube_current_ma is None else subject.seed,
        () if of_texture is None else of_texture.patches,
        None if of_texture is None else of_texture.spec_hash,
        evidence.disc if maps else None,
    )
    return CaseResults(
        case,
        subject.patient,
        _fidelity(images, given),
        textures,
        _histograms(images, given, evidence),
        inserted,
        (
            *checks,
            *cross_view(evidence, candidates),
            *of_lesions,
            *errors_against_fbp(evidence, images, candidates),
            *of_sweep,
        ),
    )


def _given(
    loaded: LoadedSubject, kept: ImageFolder, fbp: Candidate, A: Projector
) -> tuple[dict[str, Image], dict[str, StoredImage]]:
    """What a case has besides its methods: FBP of the reference scans, and the truth; readers see one reference."""
    given: dict[str, Image] = {}
    files: dict[str, StoredImage] = {}
    for name, scan in loaded.references.items():
        given[name], files[name] = kept.keep(name, partial(fbp.make, take_log(scan), A), fbp.method.settings)
    if (truth := loaded.truth) is not None:
        given["truth"], files["truth"] = kept.keep("truth", lambda: truth, {})
    files.pop("repeat", None)
    return given, files


def texture_spec(*, truth_known: bool) -> GLCMSpec:
    """Return how texture is measured; a truth chooses the patches as it is, FBP after it was smoothed for that."""
    return GLCMSpec(smoothing=0.0 if truth_known else 4.0)


def _fidelity(images: Mapping[str, Image], given: Mapping[str, Image]) -> dict[str, Values]:
    """Errors against the truth; the reference has its own."""
    if (truth := given.get("truth")) is None:
        return {}
    compared = {**images, **{name: image for name, image in given.items() if name == "reference"}}
    return {name: fidelity_values(image, truth) for name, image in compared.items()}


def _textures(images: Mapping[str, Image], given: Mapping[str, Image], evidence: Evidence) -> dict[str, Texture]:
    """Texture of all images on patches that the truth has chosen, or FBP where nobody knows it."""
    chosen_on = evidence.fbp if evidence.truth is None else evidence.truth
    spec = texture_spec(truth_known=evidence.truth is not None)
    if min(chosen_on.shape) < spec.patch or not (patches := texture_patches(chosen_on, spec=spec)):
        return {}
    return {name: texture_features(image, patches, spec=spec) for name, image in {**images, **given}.items()}


def _histograms(images: Mapping[str, Image], given: Mapping[str, Image], evidence: Evidence) -> dict[str, Values]:
    """Distances from the reference scan and from the truth, and the distance of two reference scans."""
    found: dict[str, Values] = {}
    for target, ending in (("reference", ""), ("truth", "_to_truth")):
        if target not in given:
            continue
        for name, image in {**images, **given}.items():
            if name != target:
                values = histogram_values(image, given[target], body=evidence.body)
                found.setdefault(name, {}).update({f"{key}{ending}": value for key, value in values.items()})
    repeats = [given[name] for name in ("reference", "repeat") if name in given]
    if len(repeats) == 2 and bool(evidence.body.any()):
        floor = repeat_scan_floor(torch.stack(repeats), mask=evidence.body)
        found.setdefault("reference", {})["repeat_scan_floor"] = floor
    return found


def _details(evidence: Evidence) -> tuple[Detail, ...]:
    """Two squares within the body, chosen by where it is, not by what any method has made of it."""
    rows, cols = torch.nonzero(evidence.body, as_tuple=True)
    if not len(rows):
        return ()
    size = max(8, min(evidence.body.shape) // 5)

    def around(row: float, col: float) -> Detail:
        first_row, first_col = (
            int(min(max(at - size / 2, 0), whole - size))
            for at, whole in zip((row, col), evidence.body.shape, strict=True)
        )
        return Detail(first_row, first_col, size)

    top, bottom = (float(torch.quantile(rows.double()[:: 1 + len(rows) // 10**6], q)) for q in (0.25, 0.75))
    left, right = (float(torch.quantile(cols.double()[:: 1 + len(cols) // 10**6], q)) for q in (0.3, 0.65))
    return around(top, left), around(bottom, right)
