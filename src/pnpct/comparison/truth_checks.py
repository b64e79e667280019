"""Whether the images of one case are nearer to the truth than filtered back-projection."""

from collections.abc import Iterator, Mapping
from functools import partial
from typing import get_args

from pnpct.arrays import Image
from pnpct.comparison.data_checks import Evidence
from pnpct.comparison.methods import controls
from pnpct.comparison.schema import Check, Verdict
from pnpct.evaluation import rmse_hu
from pnpct.operators import Kernel


def errors_against_fbp(evidence: Evidence, images: Mapping[str, Image]) -> Iterator[Check]:
    """Yield whether each method that is more than FBP has less error in the body than FBP with its best kernel."""
    truth, body = evidence.truth, evidence.body
    if truth is None or not bool(body.any()):
        return
    errors = {}
    for kernel in get_args(Kernel):
        fbp = controls(kernel).baseline
        make = partial(fbp.make, evidence.sinogram, evidence.projector)
        image, _ = evidence.folder.get(f"fbp-kernels/{kernel}", make, fbp.settings)
        errors[kernel] = rmse_hu(image, truth, mask=body)
    best = min(errors, key=errors.__getitem__)
    for method in evidence.methods.of("swept", "compared"):
        error = rmse_hu(images[method.name], truth, mask=body)
        share = error / errors[best]
        says = f"RMSE in the body is {error:.1f} HU; FBP with its best kernel here, {best}, has {errors[best]:.1f} HU."
        verdict: Verdict = "pass" if share <= 1 else "fail"
        yield Check("error against FBP", evidence.case, method.name, share, None, 1.0, verdict, says)
