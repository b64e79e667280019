"""All numbers that compare one image with the truth, by name; names of errors end in their unit."""

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
from jaxtyping import Float
from torch import Tensor

from pnpct.arrays import Image
from pnpct.evaluation import (
    FEATURES,
    METRICS,
    WINDOWS,
    GLCMSpec,
    Metric,
    body_mask,
    earth_movers_distance,
    errors_by_tissue,
    psnr_ldctbench,
    psnr_lodopab,
    psnr_lodopab_fr,
    ssim_ldctbench,
    ssim_lodopab,
    ssim_lodopab_fr,
    texture_features,
    texture_patches,
)
from pnpct.evaluation.image.errors import NoSuchTissueError

Values = dict[str, float | None]
"""By name; None where a number does not exist, say the decibels of a perfect image."""

PUBLISHED: dict[str, Metric] = {
    "psnr_ldctbench_chest": partial(psnr_ldctbench, exam="chest"),
    "psnr_ldctbench_abdomen": partial(psnr_ldctbench, exam="abdomen"),
    "psnr_ldctbench_head": partial(psnr_ldctbench, exam="head"),
    "ssim_ldctbench_chest": partial(ssim_ldctbench, exam="chest"),
    "ssim_ldctbench_abdomen": partial(ssim_ldctbench, exam="abdomen"),
    "ssim_ldctbench_head": partial(ssim_ldctbench, exam="head"),
    "psnr_lodopab": psnr_lodopab,
    "psnr_lodopab_fr": psnr_lodopab_fr,
    "ssim_lodopab": ssim_lodopab,
    "ssim_lodopab_fr": ssim_lodopab_fr,
}
"""Scores as two benchmarks define them, to stand beside the tables of theirs that have the same anatomy."""

_GAUSSIAN = "Gaussian of 1.5 pixels s.d. on 11 x 11 pixels"
_UNIFORM = "7 x 7 pixels of equal weight"
_LDCTBENCH = {"chest": (-600, 1500), "abdomen": (50, 400), "head": (40, 80)}
_LODOPAB: dict[str, Any] = {
    "data_range": "that of the truth",
    "mask": "whole slice",
    "scale": "(20 + 19.98 HU/1000) / 81.35858",
}


def score_definitions() -> dict[str, dict[str, Any]]:
    """Return for each ratio and similarity its window, data range, mask and surroundings, in plain values."""
    found: dict[str, dict[str, Any]] = {}
    for words, window in (("40_400", WINDOWS["abdomen"]), ("30_300", WINDOWS["mediastinum"])):
        about: dict[str, Any] = {"window_hu": list(window), "data_range_hu": window[1] - window[0], "mask": "body"}
        found |= {f"psnr_{words}": about, f"ssim_{words}": {**about, "surroundings": _GAUSSIAN}}
    for exam, (level, width) in _LDCTBENCH.items():
        window = level - width / 2, level + width / 2 - 1
        about = {"window_hu": list(window), "data_range_hu": width - 1, "mask": "whole slice"}
        found |= {f"psnr_ldctbench_{exam}": about, f"ssim_ldctbench_{exam}": {**about, "surroundings": _UNIFORM}}
    for words, about in (("lodopab", _LODOPAB), ("lodopab_fr", {**_LODOPAB, "data_range": 1})):
        found |= {f"psnr_{words}": about, f"ssim_{words}": {**about, "surroundings": _UNIFORM}}
    return found


def fidelity_values(image: Image, truth: Float[Tensor, "..."]) -> Values:
    """Return errors in HU, in all and by tissue, and the ratios and similarities that others publish.

    The tissues are ranges of the truth within the body; `soft_tissue_rmse_hu` is another region, away from edges. What
    asks for a tissue that the truth has not is None.

    Raises:
        ValueError: If the images differ in shape or a number is not finite.
    """
    values = _measured(METRICS, image, truth)
    for tissue, error in errors_by_tissue(image, truth, mask=body_mask(truth)).items():
        name = f"{tissue.replace(' ', '_')}_range"
        values |= {f"{name}_rmse_hu": error.rmse_hu, f"{name}_bias_hu": error.bias_hu}
    return values | _measured(PUBLISHED, image, truth)


def histogram_values(image: Image, reference: Float[Tensor, "..."], *, body: Tensor | None = None) -> Values:
    """Return the earth mover's distance within the body, on the axis from 0 to 1 and in HU; None without a body.

    Args:
        image: Attenuation relative to water.
        reference: What it is compared with, of the same shape.
        body: Where to count; the body of the reference if None.
    """
    body = body_mask(reference) if body is None else body
    if not bool(body.any()):
        return {"emd": None, "emd_hu": None}
    distance = earth_movers_distance(image, reference, mask=body)
    low, high = GLCMSpec().window
    return {"emd": distance, "emd_hu": distance * (high - low)}


def texture_values(image: Image, truth: Float[Tensor, "..."]) -> Values:
    """Return the GLCM features on patches of soft tissue of the truth, the mean over the slices that have any.

    They are None where there is no such patch, or a slice is smaller than one.

    Raises:
        ValueError: If a number is not finite.
    """
    spec = GLCMSpec()
    slices, truths = (each.reshape(-1, *each.shape[-2:]) for each in (image, truth))
    measured = []
    if min(truth.shape[-2:]) >= spec.patch:
        for one, known in zip(slices, truths, strict=True):
            if patches := texture_patches(known, spec=spec):
                measured.append(texture_features(one, patches, spec=spec))
    if not measured:
        return {f"glcm_{name}": None for name in FEATURES}
    return {f"glcm_{name}": float(np.mean([getattr(each, name) for each in measured])) for name in FEATURES}


def why_no_texture(truth: Float[Tensor, "..."]) -> str:
    """Return why `texture_values` has no number on a truth, and what would be needed, in a sentence."""
    spec = GLCMSpec()
    rows, cols = truth.shape[-2:]
    if min(rows, cols) < spec.patch:
        return f"patches have {spec.patch} x {spec.patch} pixels, the images only {rows} x {cols}."
    low, high = spec.tissue
    return (
        f"no patch of {spec.patch} x {spec.patch} pixels of the truth lies {spec.margin} pixels below the skin, "
        f"with {low:g} to {high:g} HU throughout and a spread below {spec.spread:g} HU; a noisy truth has none."
    )


def _measured(metrics: Mapping[str, Metric], image: Image, truth: Tensor) -> Values:
    values: Values = {}
    for name, metric in metrics.items():
        try:
            value = metric(image, truth)
        except NoSuchTissueError:
            values[name] = None
        else:
            values[name] = value if abs(value) < float("inf") else None
    return values
