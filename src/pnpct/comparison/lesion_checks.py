"""What is left of a lesion that was put into the data of one case."""

import math
from collections.abc import Mapping
from functools import partial

import numpy as np
from scipy import ndimage

from pnpct.arrays import Image
from pnpct.comparison.data_checks import Evidence
from pnpct.comparison.phantoms import lesion_in_words
from pnpct.comparison.schema import Check, Verdict
from pnpct.evaluation import LesionRecovery, insert_lesion, lesion_recovery
from pnpct.geometry import Lesion
from pnpct.operators import Projector
from pnpct.physics import Sinogram
from pnpct.units import to_hu

RECOVERED = (0.8, 1.1)
"""Share of a lesion's contrast that an image must have."""

LEAST_D_PRIME = 3.0
"""d′ from which on a lesion must be recovered: what the data hardly show, an image need not show either."""


def lesions(evidence: Evidence, images: Mapping[str, Image]) -> tuple[dict[str, LesionRecovery], tuple[Check, ...]]:
    """Put a lesion into the data, reconstruct again by every method, and judge what is left of it."""
    study, A = evidence.study, evidence.projector
    if study.lesion_hu == 0:
        return {}, ()
    shown = evidence.fbp if evidence.truth is None else evidence.truth
    if (place := _quiet_place(shown, A, study.lesion_diameter)) is None:
        says = "The images show no soft tissue with room for a lesion."
        return {}, (Check("lesion recovery", evidence.case, None, None, *RECOVERED, "not judged", says),)
    lesion = Lesion((*place, 0.0), study.lesion_diameter / 2, study.lesion_hu)
    present = insert_lesion(evidence.sinogram, A, lesion)
    d_prime = _ideal_d_prime(evidence, present)
    found: dict[str, LesionRecovery] = {}
    for method in evidence.methods:
        settings = {**method.settings, "lesion": [*lesion.center, lesion.radius, lesion.contrast_hu]}
        make = partial(method.make, present, A)
        image, _ = evidence.folder.get(f"with-lesion/{method.name}", make, settings)
        found[method.name] = lesion_recovery(image, images[method.name], lesion, A.grid)
    return found, tuple(_recovery(evidence.case, name, one, d_prime) for name, one in found.items())


def _recovery(case: str, name: str, found: LesionRecovery, d_prime: float) -> Check:
    (low, high), share = RECOVERED, found.recovered
    words = lesion_in_words(2 * found.lesion.radius, found.lesion.contrast_hu)
    says = f"Of a lesion of {words} the image has {100 * share:.0f} %; the data show it with d′ {d_prime:.1f}"
    verdict: Verdict = "pass" if low <= share <= high else "fail"
    if d_prime < LEAST_D_PRIME:
        verdict = "not judged"
        says += f", and below {LEAST_D_PRIME:g} it need not be seen"
    return Check("lesion recovery", case, name, share, low, high, verdict, f"{says}.")


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
