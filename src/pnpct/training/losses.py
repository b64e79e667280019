"""The loss terms of the paper's two stages, from an output and its target to a scalar.

Images are relative to water, so squared errors are in (HU / 1000)² and the weights of the other terms are too. Where
the paper's formula cannot do what its text says, the default is "corrected", and "paper" is the formula as printed.
"""

from collections.abc import Callable
from typing import Literal, TypeAlias

import torch
from jaxtyping import Float
from torch import Tensor

from pnpct.arrays import Image
from pnpct.training.local_statistics import GAUSSIAN, LocalEntropy, Taps, local_entropy, ssim_map
from pnpct.units import to_hu

Scalar: TypeAlias = Float[Tensor, ""]

LossTerm: TypeAlias = Callable[[Image, Image], Scalar]
"""From an output and its target to a loss term."""

Form: TypeAlias = Literal["corrected", "paper"]
"""What the paper describes, or its formula as printed."""

TEXTURE_WEIGHT = 5e-5
"""λ_tex, in (HU / 1000)², for a reference with the noise of a routine high dose; the paper gives none."""

CONTRAST_WEIGHT = 3e-5
"""λ_ca, in (HU / 1000)², for the same reference; the paper gives none."""


def mean_squared_error(output: Image, target: Float[Tensor, "..."]) -> Scalar:
    """Return the mean of (output − target)², in (HU / 1000)².

    This is the loss that a noisy target does not bias: noise of mean zero adds its variance, a constant.

    Raises:
        ValueError: If the shapes differ.

    Example:
        >>> mean_squared_error(torch.full((4, 4), 1.5), torch.ones(4, 4))
        tensor(0.2500)
    """
    _check_shapes(output, target)
    return (output - target).square().mean()


def ssim_loss(
    output: Image, target: Float[Tensor, "..."], *, data_range_hu: float = 2000.0, taps: Taps = GAUSSIAN
) -> Scalar:
    """Return 1 − the mean structural similarity.

    Against a target with noise the best output is not the truth: for a signal of variance s² and noise of variance n²
    in the target, the similarity is highest for the truth with its contrast multiplied by

        a = (−C₂ + √(C₂² + 4 s² (s² + n² + C₂))) / (2 s²) > 1.

    A large data range keeps that small. (Squared errors are least at a = 1.)

    Args:
        output: Attenuation relative to water.
        target: What it should be, of the same shape.
        data_range_hu: L > 0, HU, of which C₂ = (0.03 L)²; from air to dense bone by default.
        taps: The window.

    Returns:
        A number from 0 to 2.

    Raises:
        ValueError: If the shapes differ, or the images are smaller than the window.

    References:
        Wang et al., IEEE Trans. Image Process. 13 (2004) 600, for the similarity.
    """
    _check_shapes(output, target)
    return 1 - ssim_map(output, target, data_range_hu=data_range_hu, taps=taps).mean()


def texture_loss(
    output: Image,
    target: Float[Tensor, "..."],
    *,
    form: Form = "corrected",
    entropy: LocalEntropy = local_entropy,
) -> Scalar:
    """Ask for as much texture around each pixel as the target has.

        corrected:   mean of max(0, H(target) − H(output))
        paper:       mean of −H(output)

    with H the local entropy. As printed, the entropy rises without an end: beside squared errors, λ times the
    paper's form leaves noise of s.d. √(λ/2), whatever the target has (λ = 2·10⁻⁴: 10 HU). The corrected form leaves
    the same, but never more than the target's own, and does not pay for blur in place of noise. The paper sums over
    the pixels; a mean makes λ one number for images of every size.

    Args:
        output: Attenuation relative to water.
        target: The high-dose image, of the same shape; "paper" does not look at it.
        form: "corrected" or "paper".
        entropy: `local_entropy`, perhaps with another window or floor.

    Returns:
        Nats; 0 or more if corrected.

    Raises:
        ValueError: If the shapes differ, or the images are smaller than the window.

    References:
        The paper, section 2.3, L_tex.
    """
    _check_shapes(output, target)
    if form == "paper":
        return -entropy(output).mean()
    with torch.no_grad():
        wanted = entropy(target)
    return torch.relu(wanted - entropy(output)).mean()


def soft_tissue_weight(
    image: Image, *, center_hu: float = 40.0, width_hu: float = 120.0, gain: float = 4.0
) -> Float[Tensor, "*batch rows cols"]:
    """Weigh pixels by how much they look like soft tissue: 1 + gain · exp(−((HU − center) / width)⁴).

    Args:
        image: Attenuation relative to water.
        center_hu: Where the weight is largest; liver and muscle are at 50 to 60 HU, water at 0.
        width_hu: Half of the width of the bump, HU, > 0.
        gain: By how much the weight in the middle exceeds that of air and bone, ≥ 0.

    Returns:
        From 1 to 1 + gain.
    """
    return 1 + gain * torch.exp(-(((to_hu(image) - center_hu) / width_hu) ** 4))


def contrast_loss(
    output: Image,
    target: Float[Tensor, "..."],
    *,
    form: Form = "corrected",
    data_range_hu: float = 400.0,
    taps: Taps = GAUSSIAN,
) -> Scalar:
    """Ask for the target's structure, most of all in soft tissue.

        corrected:   Σ_j w_j (1 − SSIM_j) / Σ_j w_j
        paper:       mean SSIM(w · output, w · target)

    with w = `soft_tissue_weight` of the target. Two things are wrong with the printed form. A similarity is added
    to a loss, so that training makes the images dissimilar. And a weight inside the similarity cancels: where w
    is locally constant it only divides C₁ and C₂ by w², and where it is not it makes edges that no image has.

    Args:
        output: Attenuation relative to water.
        target: The high-dose image, of the same shape.
        form: "corrected" or "paper".
        data_range_hu: L > 0, HU; 400 is a usual window for soft tissue.
        taps: The window.

    Returns:
        From 0 to 2 if corrected, from −1 to 1 if not.

    Raises:
        ValueError: If the shapes differ, or the images are smaller than the window.

    References:
        The paper, section 2.3, L_ca.
    """
    _check_shapes(output, target)
    weight = soft_tissue_weight(target)
    if form == "paper":
        return ssim_map(weight * output, weight * target, data_range_hu=data_range_hu, taps=taps).mean()
    similarity = ssim_map(output, target, data_range_hu=data_range_hu, taps=taps)
    reach = len(taps) // 2
    weight = weight[..., reach : weight.shape[-2] - reach, reach : weight.shape[-1] - reach]
    return (weight * (1 - similarity)).sum() / weight.sum()


def stage_one_loss(output: Image, target: Float[Tensor, "..."], *, ssim_weight: float = 1e-4) -> Scalar:
    """Return the loss for pairs of noisy images: squared errors, and a little structural similarity.

        L = mean (output − target)² + ssim_weight · (1 − SSIM)

    The formula is as printed; its weight is not given. The target is noisy, and then the similarity asks for too
    much contrast (`ssim_loss`). Its derivative at the truth bounds the excess by ssim_weight / (4 C₂), whatever
    signal and noise are: 0.7 % by default, with C₂ of 2000 HU. At 0 the loss is the one that pairs of noisy images
    are known to train without bias; lower it to 0 towards the end.

    Args:
        output: Attenuation relative to water.
        target: A second image of the same object with noise of its own, of the same shape.
        ssim_weight: λ_SSIM ≥ 0, in (HU / 1000)².

    Returns:
        The loss, in (HU / 1000)².

    Raises:
        ValueError: If the shapes differ, or the images are smaller than 11 × 11 pixels.

    References:
        The paper, section 2.3, stage 1; Lehtinen et al., ICML 2018.
    """
    loss = mean_squared_error(output, target)
    return loss + ssim_weight * ssim_loss(output, target) if ssim_weight else loss


def stage_two_loss(
    output: Image,
    target: Float[Tensor, "..."],
    *,
    form: Form = "corrected",
    texture_weight: float = TEXTURE_WEIGHT,
    contrast_weight: float = CONTRAST_WEIGHT,
) -> Scalar:
    """Return the loss for pairs of a low-dose and a high-dose image: squared errors, texture and contrast.

        L = mean (output − target)² + texture_weight · L_tex + contrast_weight · L_ca

    Args:
        output: Attenuation relative to water.
        target: The high-dose image, of the same shape.
        form: Of `texture_loss` and `contrast_loss`.
        texture_weight: λ_tex ≥ 0, in (HU / 1000)²: it leaves noise of at most √(λ_tex / 2), 5 HU by default.
        contrast_weight: λ_ca ≥ 0, in (HU / 1000)². Errors of the size of a target's noise of 10 HU count an eighth
            more by default; since the target is noisy, the contrast of faint details rises by λ_ca / (4 C₂) = 5 %
            at most (times their weight over the mean weight). A target with less noise bears more.

    Returns:
        The loss, in (HU / 1000)².

    Raises:
        ValueError: If the shapes differ, or the images are smaller than 11 × 11 pixels.

    References:
        The paper, section 2.3, stage 2.
    """
    loss = mean_squared_error(output, target)
    if texture_weight:
        loss = loss + texture_weight * texture_loss(output, target, form=form)
    if contrast_weight:
        loss = loss + contrast_weight * contrast_loss(output, target, form=form)
    return loss


def _check_shapes(output: Tensor, target: Tensor) -> None:
    # Shapes that broadcast would give a number all the same.
    if output.shape != target.shape:
        raise ValueError(
            f"An output and its target must have one shape, got {tuple(output.shape)} and {tuple(target.shape)}."
        )
