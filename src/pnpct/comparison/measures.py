"""All numbers that compare one image with the truth, by name; names of errors end in their unit."""

from jaxtyping import Float
from torch import Tensor

from pnpct.arrays import Image
from pnpct.evaluation import (
    FEATURES,
    GLCMSpec,
    body_mask,
    earth_movers_distance,
    errors_by_tissue,
    evaluate,
    psnr_lodopab,
    psnr_lodopab_fr,
    ssim_lodopab,
    ssim_lodopab_fr,
    texture_features,
    texture_patches,
)

Values = dict[str, float | None]
"""By name; None where a number does not exist, say the decibels of a perfect image."""

PUBLISHED = {
    "psnr_lodopab": psnr_lodopab,
    "psnr_lodopab_fr": psnr_lodopab_fr,
    "ssim_lodopab": ssim_lodopab,
    "ssim_lodopab_fr": ssim_lodopab_fr,
}
"""Scores as a benchmark defines them, to stand beside its table."""


def fidelity_values(image: Image, truth: Float[Tensor, "..."]) -> Values:
    """Return errors in HU, in all and by tissue, and the ratios and similarities that others publish.

    The tissues are ranges of the truth within the body; `soft_tissue_rmse_hu` is another region, away from edges.

    Raises:
        ValueError: If the images differ in shape, a number is not finite, or the truth has no soft tissue.
    """
    values: Values = {name: _finite(value) for name, value in evaluate(image, truth).items()}
    for tissue, error in errors_by_tissue(image, truth, mask=body_mask(truth)).items():
        name = f"{tissue.replace(' ', '_')}_range"
        values |= {f"{name}_rmse_hu": error.rmse_hu, f"{name}_bias_hu": error.bias_hu}
    return values | {name: _finite(score(image, truth)) for name, score in PUBLISHED.items()}


def histogram_values(image: Image, truth: Float[Tensor, "..."]) -> Values:
    """Return the earth mover's distance within the body, on the axis from 0 to 1 and in HU."""
    distance = earth_movers_distance(image, truth, mask=body_mask(truth))
    low, high = GLCMSpec().window
    return {"emd": distance, "emd_hu": distance * (high - low)}


def texture_values(image: Image, truth: Float[Tensor, "..."]) -> Values:
    """Return the GLCM features on patches of soft tissue of the truth; none where it has no such patch."""
    spec = GLCMSpec()
    if min(truth.shape) < spec.patch or not (patches := texture_patches(truth, spec=spec)):
        return {}
    features = texture_features(image, patches, spec=spec)
    return {f"glcm_{name}": getattr(features, name) for name in FEATURES}


def _finite(value: float) -> float | None:
    return value if abs(value) < float("inf") else None
