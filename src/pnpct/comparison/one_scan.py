"""One scan by all methods: its images, and what was measured of them."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import torch

from pnpct.arrays import Image
from pnpct.comparison.data_checks import Evidence, cross_view, judge, weaker_prior
from pnpct.comparison.lesion_checks import lesions
from pnpct.comparison.measures import Values, fidelity_values, histogram_values
from pnpct.comparison.methods import Candidate, Candidates
from pnpct.comparison.schema import Case, Check, Detail, StoredImage
from pnpct.comparison.stored_images import ImageFolder
from pnpct.comparison.study import Study
from pnpct.comparison.subjects import LoadedSubject, Subject
from pnpct.comparison.truth_checks import errors_against_fbp
from pnpct.evaluation import GLCMSpec, LesionRecovery, Texture, repeat_scan_floor, texture_features, texture_patches
from pnpct.files import sha256_of
from pnpct.operators import Projector
from pnpct.physics import take_log
from pnpct.reconstruction import corrected_for_bone


@dataclass(frozen=True)
class OneScan:
    """All of one scan.

    Args:
        case: The scan, with its images.
        patient: Whose slice it is.
        fidelity: Errors by method.
        texture: Texture by method, and of "reference", "repeat" and "truth"; empty where there is no soft tissue.
        histogram: Distances of histograms by the same names, and the floor of the reference.
        lesions: What is left of a lesion, by method.
        checks: What was checked.
    """

    case: Case
    patient: str
    fidelity: Mapping[str, Values]
    texture: Mapping[str, Texture]
    histogram: Mapping[str, Values]
    lesions: Mapping[str, LesionRecovery]
    checks: tuple[Check, ...]


def compare_one_scan(folder: Path, subject: Subject, methods: Candidates, study: Study) -> OneScan:
    """Reconstruct one scan by all methods, store the images, and measure them.

    Raises:
        OSError: If a file cannot be read or written.
        ValueError: If the scan or a setting is not what it should be.
    """
    loaded = subject.load()
    grid, geometry = loaded.grid, loaded.scan.geometry
    A = Projector(grid, geometry, mu_water=loaded.scan.mu_water)
    sinogram = corrected_for_bone(take_log(loaded.scan), A)
    origin = {"scan": {**asdict(subject), "file": sha256_of(subject.file)}}
    store = ImageFolder(folder, f"images/{subject.name}", grid, origin)
    files: dict[str, StoredImage] = {}
    images: dict[str, Image] = {}
    for method in methods:
        make = partial(method.make, sinogram, A)
        images[method.name], files[method.name] = store.get(method.name, make, method.settings)
    given, files_given = _given(loaded, store, methods.baseline, A)
    fbp = images[methods.baseline.name]
    evidence = Evidence(subject.name, sinogram, A, loaded.truth, fbp, methods, study, store)
    maps, of_data = judge(evidence, images)
    swept, of_prior = weaker_prior(evidence, images)
    inserted, of_lesions = lesions(evidence, images)
    textures = _textures(images, given, evidence)
    measured = next(iter(textures.values()), None)
    case = Case(
        subject.name,
        subject.label,
        subject.tube_current_ma,
        subject.tube_voltage_kvp,
        grid,
        str(geometry),
        _details(evidence),
        images={**files, **files_given},
        maps={name: {**of_image, **swept.get(name, {})} for name, of_image in maps.items()},
        seed=None if subject.tube_current_ma is None else subject.seed,
        patches=() if measured is None else measured.patches,
        texture_spec_hash=None if measured is None else measured.spec_hash,
        disc_mm=evidence.disc if maps else None,
    )
    checks = *of_data, *cross_view(evidence), *of_lesions, *errors_against_fbp(evidence, images), *of_prior
    histograms = _histograms(images, given, evidence)
    return OneScan(case, subject.patient, _fidelity(images, given), textures, histograms, inserted, checks)


def _given(
    loaded: LoadedSubject, store: ImageFolder, fbp: Candidate, A: Projector
) -> tuple[dict[str, Image], dict[str, StoredImage]]:
    """What a case has besides its methods: FBP of the reference scans, and the truth; readers see one reference."""
    given: dict[str, Image] = {}
    files: dict[str, StoredImage] = {}
    for name, scan in loaded.references.items():
        given[name], files[name] = store.get(name, partial(fbp.make, take_log(scan), A), fbp.settings)
    if (truth := loaded.truth) is not None:
        given["truth"], files["truth"] = store.get("truth", lambda: truth, {})
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
