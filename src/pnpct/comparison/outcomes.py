"""Two questions about the images of one case: do they keep a lesion, and are they nearer to the truth than FBP?"""

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import get_args

import numpy as np
from scipy import ndimage

from pnpct.arrays import Image
from pnpct.comparison.candidates import Candidate, filtered
from pnpct.comparison.honesty import Evidence
from pnpct.comparison.results import Check, LesionResult, Verdict
from pnpct.evaluation import insert_lesion, lesion_recovery, rmse_hu
from pnpct.geometry import Lesion
from pnpct.operators import Kernel, Projector
from pnpct.physics import Sinogram
from pnpct.reconstruction import FBP
from pnpct.units import to_hu

RECOVERED = (0.8, 1.1)
"""Share of a lesion's contrast that an image must have."""

LEAST_D_PRIME = 3.0
"""d′ from which on a lesion must be recovered: what the data hardly show, an image need not show either."""


def lesions(
    evidence: Evidence, images: Mapping[str, Image], candidates: Sequence[Candidate]
) -> tuple[tuple[LesionResult, ...], tuple[Check, ...]]:
    """Put a lesion into the data, reconstruct again by every method, and judge what is left of it."""
    plan, A = evidence.plan, evidence.projector
    if plan.lesion_hu == 0:
        return (), ()
    shown = evidence.fbp if evidence.truth is None else evidence.truth
    if (place := _quiet_place(shown, A, plan.lesion_diameter)) is None:
        says = "The images show no soft tissue with room for a lesion."
        return (), (Check("lesion recovery", evidence.case, None, None, *RECOVERED, "not judged", says),)
    lesion = Lesion((*place, 0.0), plan.lesion_diameter / 2, plan.lesion_hu)
    present = insert_lesion(evidence.sinogram, A, lesion)
    d_prime = _ideal_d_prime(evidence, present)
    words = f"{plan.lesion_diameter:g} mm, {plan.lesion_hu:+g} HU".replace("-", "−")
    results, checks = [], []
    for candidate in candidates:
        name = candidate.method.name
        settings = {**candidate.method.settings, "lesion": [*lesion.center, lesion.radius, lesion.contrast_hu]}
        image, _ = evidence.folder.keep(f"with-lesion/{name}", partial(candidate.make, present, A), settings)
        one = lesion_recovery(image, images[name], lesion, A.grid)
        figures = one.recovered, one.spill, one.distant_hu
        results.append(LesionResult(evidence.case, name, words, plan.lesion_hu, *figures))
        checks.append(_recovery(evidence.case, name, words, one.recovered, d_prime))
    return tuple(results), tuple(checks)


def _recovery(case: str, name: str, words: str, recovered: float, d_prime: float) -> Check:
    says = f"Of a lesion of {words} the image has {100 * recovered:.0f} %; the data show it with d′ {d_prime:.1f}"
    low, high = RECOVERED
    verdict: Verdict = "pass" if low <= recovered <= high else "fail"
    if d_prime < LEAST_D_PRIME:
        verdict = "not judged"
        says += f", and below {LEAST_D_PRIME:g} it need not be seen"
    return Check("lesion recovery", case, name, recovered, low, high, verdict, f"{says}.")


def errors_against_fbp(
    evidence: Evidence, images: Mapping[str, Image], candidates: Sequence[Candidate]
) -> Iterator[Check]:
    """Yield whether each method that is more than FBP has less error in the body than FBP with its best kernel."""
    truth, body = evidence.truth, evidence.body
    if truth is None or not bool(body.any()):
        return
    errors = {}
    for kernel in get_args(Kernel):
        fbp = filtered(FBP(kernel))
        make = partial(fbp.make, evidence.sinogram, evidence.projector)
        image, _ = evidence.folder.keep(f"fbp-kernels/{kernel}", make, fbp.method.settings)
        errors[kernel] = rmse_hu(image, truth, mask=body)
    best = min(errors, key=errors.__getitem__)
    for candidate in candidates:
        if candidate.method.kind in ("fbp", "control"):
            continue
        name = candidate.method.name
        error = rmse_hu(images[name], truth, mask=body)
        share = error / errors[best]
        says = f"RMSE in the body is {error:.1f} HU; FBP with its best kernel here, {best}, has {errors[best]:.1f} HU."
        verdict: Verdict = "pass" if share <= 1 else "fail"
        yield Check("error against FBP", evidence.case, name, share, None, 1.0, verdict, says)


def _ideal_d_prime(evidence: Evidence, present: Sinogram) -> float:
    """√(qᵀW q), with q the projection of the lesion: no observer of any image does better."""
    q = present.line_integrals - evidence.sinogram.line_integrals
    return math.sqrt(float((q * evidence.sinogram.weights(q)).double().sum()) / evidence.floor)


def _quiet_place(image: Image, A: Projector, diameter: float) -> tuple[float, float] | None:
    """Where soft tissue varies least over twice the lesion's diameter: there it is a lesion and no vessel's edge."""
    grid = A.grid
    hu = ndimage.uniform_filter(to_hu(image.double()).cpu().numpy(), 3)
    side = max(3, round(2 * diameter / grid.spacing))
    mean = ndimage.uniform_filter(hu, side)
    spread = np.sqrt(np.maximum(ndimage.uniform_filter(hu**2, side) - mean**2, 0.0))
    soft = (mean > -20) & (mean < 120) & (ndimage.minimum_filter(hu, side) > -200)
    rows, cols = (np.minimum(at - at.min(), at.max() - at) >= diameter / 2 for at in (grid.y, grid.x))
    soft &= rows[:, None] & cols
    if not soft.any():
        return None
    row, col = np.unravel_index(int(np.argmin(np.where(soft, spread, np.inf))), spread.shape)
    return float(grid.x[col]), float(grid.y[row])
