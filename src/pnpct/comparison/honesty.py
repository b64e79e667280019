"""The honesty checks of one case: what the data say of its images, without any truth."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import torch
from scipy import ndimage

from pnpct.arrays import Image
from pnpct.comparison.candidates import Candidate
from pnpct.comparison.plan import Plan
from pnpct.comparison.results import Check, LesionResult, StoredImage, Verdict
from pnpct.comparison.stored_images import ImageFolder
from pnpct.evaluation import body_mask, consistency, insert_lesion, lesion_recovery, prior_sweep, score_test
from pnpct.evaluation.disc_information import disc_information
from pnpct.operators import Projector
from pnpct.physics import Sinogram
from pnpct.simulation import Lesion
from pnpct.units import to_hu

DISC = 8.0
"""Diameter of the discs of the score test, mm."""

LARGEST_T = 5.0
"""|T| that an independent truth exceeds somewhere once in twenty scans. An image that was fitted to the data stays far
below it, so this finds gross errors only; `score_threshold` has the limit of one method, at forty times the time."""

WEAKER = 0.1
"""Share of the penalty that the sweep towards no prior goes down to."""

Maps = Mapping[str, Mapping[str, StoredImage]]


@dataclass(frozen=True, eq=False)
class Evidence:
    """What the checks of one case are made of.

    Args:
        case: Its name.
        sinogram: Its data.
        projector: A.
        truth: The object; None if it is not known.
        plan: Settings of the methods.
        folder: Where its images are kept.
    """

    case: str
    sinogram: Sinogram
    projector: Projector
    truth: Image | None
    plan: Plan
    folder: ImageFolder


def judge(evidence: Evidence, images: Mapping[str, Image]) -> tuple[Maps, tuple[Check, ...]]:
    """Test every image against the data; return the maps that are kept, and the verdicts."""
    sinogram, A, truth = evidence.sinogram, evidence.projector, evidence.truth
    floor = _floor(evidence)
    disc = _disc(A)
    information = disc_information(sinogram.weights, A, disc)
    inside = body_mask(next(iter(images.values())) if truth is None else truth)
    checks: list[Check] = []
    maps: dict[str, dict[str, StoredImage]] = {}
    for name, image in images.items():
        checks.append(_residual(evidence, name, image, floor))
        test = score_test(image, sinogram, A, diameter=disc, floor=floor, information=information)
        found = test.strongest_within(inside)
        says = (
            f"At ({found.position[0]:.0f}, {found.position[1]:.0f}) mm the data want {found.missing_hu:+.0f} HU more "
            f"in a disc of {disc:g} mm; they can tell {found.verifiable_hu:.0f} HU there."
        )
        verdict: Verdict = "pass" if abs(found.t) <= LARGEST_T else "fail"
        checks.append(Check("largest score", evidence.case, name, found.t, -LARGEST_T, LARGEST_T, verdict, says))
        shown = {"t": test.t, "verifiable_hu": torch.where(inside, test.verifiable_hu, 0.0)}
        settings = {"disc": disc, "image": _settings_of(evidence, name)}
        maps[name] = {
            what: evidence.folder.keep(f"maps/{name}-{what}", values.float, settings)[1]
            for what, values in shown.items()
        }
    return maps, tuple(checks)


def sweep(evidence: Evidence, image: Image) -> Check:
    """Ask what the image of the last method shows only because its prior is strong."""
    weak = replace(evidence.plan, beta=WEAKER * evidence.plan.beta).candidates()[-1]
    name, settings = weak.method.name, weak.method.settings
    sinogram, A = evidence.sinogram, evidence.projector
    weaker, _ = evidence.folder.keep(f"maps/{name}-weak-prior", partial(weak.make, sinogram, A), settings)
    disc = _disc(A)
    test = score_test(image, sinogram, A, diameter=disc, floor=_floor(evidence))
    inside = body_mask(image if evidence.truth is None else evidence.truth)
    (found,) = prior_sweep({WEAKER: weaker, 1.0: image}, test, mask=inside)
    return Check(
        "prior-off sweep",
        evidence.case,
        name,
        found.largest,
        None,
        1.0,
        "pass" if found.largest <= 1 else "not judged",
        f"With a tenth of the penalty a disc of {disc:g} mm changes by {-found.change_hu:+.0f} HU at most, "
        f"{found.largest:.2f} times what the data can tell there.",
    )


def lesions(
    evidence: Evidence, images: Mapping[str, Image], candidates: Sequence[Candidate]
) -> tuple[LesionResult, ...]:
    """Put a lesion into the data, reconstruct again by every method, and measure what is left of it."""
    plan, A = evidence.plan, evidence.projector
    if plan.lesion_hu == 0:
        return ()
    shown = next(iter(images.values())) if evidence.truth is None else evidence.truth
    lesion = Lesion((*_quiet_place(shown, A, plan.lesion_diameter), 0.0), plan.lesion_diameter / 2, plan.lesion_hu)
    present = insert_lesion(evidence.sinogram, A, lesion)
    words = f"{plan.lesion_diameter:g} mm, {plan.lesion_hu:+g} HU".replace("-", "−")
    found = []
    for candidate in candidates:
        name = candidate.method.name
        settings = {**candidate.method.settings, "lesion": [*lesion.center, lesion.radius, lesion.contrast_hu]}
        image, _ = evidence.folder.keep(f"with-lesion/{name}", partial(candidate.make, present, A), settings)
        one = lesion_recovery(image, images[name], lesion, A.grid)
        figures = one.recovered, one.spill, one.distant_hu
        found.append(LesionResult(evidence.case, name, words, plan.lesion_hu, *figures))
    return tuple(found)


def _floor(evidence: Evidence) -> float:
    """The chi-square of the truth: what beam hardening and pixels leave even there."""
    if evidence.truth is None:
        return 1.0
    return consistency(evidence.truth, evidence.sinogram, evidence.projector).chi2


def _disc(A: Projector) -> float:
    """Coarse images have no discs as small as these."""
    return max(DISC, 2 * A.grid.spacing)


def _residual(evidence: Evidence, name: str, image: Image, floor: float) -> Check:
    found = consistency(image, evidence.sinogram, evidence.projector, floor=floor)
    high = found.band[1]
    against = "1" if evidence.truth is None else "that of the truth"
    says = (
        f"The residual's chi-square is {found.ratio:.3f} times {against}; neighbouring residuals correlate by "
        f"{found.along_views:+.2f} along views and {found.along_bins:+.2f} along bins."
    )
    verdict: Verdict = "pass" if found.ratio <= high else "fail"
    return Check("residual chi-square", evidence.case, name, found.ratio, None, high, verdict, says)


def _settings_of(evidence: Evidence, name: str) -> dict[str, object]:
    (method,) = (each.method for each in evidence.plan.candidates() if each.method.name == name)
    return dict(method.settings)


def _quiet_place(image: Image, A: Projector, diameter: float) -> tuple[float, float]:
    """Where soft tissue varies least over twice the lesion's diameter: there it is a lesion and no vessel's edge."""
    hu = ndimage.uniform_filter(to_hu(image.double()).cpu().numpy(), 3)
    side = max(3, round(2 * diameter / A.grid.spacing))
    mean = ndimage.uniform_filter(hu, side)
    spread = np.sqrt(np.maximum(ndimage.uniform_filter(hu**2, side) - mean**2, 0.0))
    soft = (mean > -20) & (mean < 120) & (ndimage.minimum_filter(hu, side) > -200)
    if not soft.any():
        raise ValueError("The images show no soft tissue to put a lesion into; compare without one.")
    row, col = np.unravel_index(int(np.argmin(np.where(soft, spread, np.inf))), spread.shape)
    return float(A.grid.x[col]), float(A.grid.y[row])
