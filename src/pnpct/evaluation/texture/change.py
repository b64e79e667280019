"""What a method did to the texture: its change from FBP, and how near it came to the reference."""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pnpct.evaluation.intervals import Interval, bootstrap
from pnpct.evaluation.texture.glcm import FEATURES, Texture

LEAST_CASES = 5
"""Cases that an interval needs: resamples of fewer are a handful of combinations, and it would be far too narrow."""


@dataclass(frozen=True)
class FeatureChange:
    """One feature of a method, of FBP and of the reference.

    Args:
        feature: Its name, one of `FEATURES`.
        method: Mean over the images.
        fbp: Mean over the same images, reconstructed by FBP.
        reference: Mean over their references; None if there are none.
        ratio_of_means: 100 (method/fbp − 1), percent: what the means above give.
        mean_of_ratios: 100 times the mean of (methodᵢ/fbpᵢ − 1), percent.
        interval: `ratio_of_means` with its interval over cases; None with fewer than five (`LEAST_CASES`).
        closeness: 1 − |method − reference| / |fbp − reference|: 1 is at the reference, 0 as far as FBP, negative
            farther. None if there is no reference, one case, or FBP is within two standard errors of it.
    """

    feature: str
    method: float
    fbp: float
    reference: float | None
    ratio_of_means: float
    mean_of_ratios: float
    interval: Interval | None
    closeness: float | None

    @property
    def images_disagree(self) -> bool:
        """Whether the two percentages are more than 10 points apart: a few images decide."""
        return abs(self.ratio_of_means - self.mean_of_ratios) > 10.0


@dataclass(frozen=True)
class TextureChange:
    """All features of a method against FBP and the reference.

    Args:
        features: One change for each of `FEATURES`, in their order.
        spec_hash: `GLCMSpec.hash` of the definition that all were measured with.
    """

    features: tuple[FeatureChange, ...]
    spec_hash: str

    def __getitem__(self, feature: str) -> FeatureChange:
        """Return the change of one of `FEATURES`."""
        return self.features[FEATURES.index(feature)]

    @property
    def closeness(self) -> float | None:
        """The mean closeness over the features that have one, to rank methods by; None if none has."""
        known = [change.closeness for change in self.features if change.closeness is not None]
        return float(np.mean(known)) if known else None

    @property
    def oversmoothed(self) -> bool:
        """Whether the method is smoother than the reference, and farther from it than FBP.

        Its contrast is below the reference's, and its homogeneity above it by more than FBP's differs from it.
        Percentages alone would praise such an image. It compares means and also answers where closeness, for
        want of cases, does not; without a reference nothing is known and the answer is no.
        """
        contrast, homogeneity = self["contrast"], self["homogeneity"]
        if contrast.reference is None or homogeneity.reference is None:
            return False
        overshoot = homogeneity.method - homogeneity.reference
        return contrast.method < contrast.reference and overshoot > abs(homogeneity.fbp - homogeneity.reference)


def texture_change(
    method: Sequence[Texture],
    fbp: Sequence[Texture],
    reference: Sequence[Texture] | None,
    *,
    generator: np.random.Generator,
    cases: Sequence[Hashable] | None = None,
    resamples: int = 2000,
) -> TextureChange:
    """Compare the texture of a method's images with FBP and with the reference, image by image.

    With mᵢ, fᵢ and gᵢ a feature of image i by the method, by FBP and in the reference, and means without index:

        ratio of means = 100 (m/f − 1),   mean of ratios = 100 mean(mᵢ/fᵢ − 1),   closeness = 1 − |m − g|/|f − g|.

    Closeness is what counts. A percentage is no improvement: a constant image has the largest.

    Args:
        method: Texture of each image.
        fbp: Texture of FBP of the same scans, on the same patches.
        reference: Texture of the references, on the same patches; None if there are none.
        generator: Source of the bootstrap.
        cases: The patient of each image; every image is its own case if None.
        resamples: Resamples of the bootstrap, at least 2.

    Returns:
        The change of every feature.

    Raises:
        ValueError: If the lists do not belong together (lengths, patches, definitions), or FBP has a feature
            that is 0.
    """
    _check_alike(method, fbp, reference)
    if cases is not None and len(cases) != len(method):
        raise ValueError(f"Every image needs its case: there are {len(method)} images, got {len(cases)} cases.")
    different = len(set(cases if cases is not None else range(len(method))))
    interval = partial(bootstrap, generator=generator, cases=cases, resamples=resamples)
    features = []
    for feature in FEATURES:
        m, f = _values(method, feature), _values(fbp, feature)
        g = None if reference is None else _values(reference, feature)
        if (f == 0).any():
            raise ValueError(f"FBP must have a {feature} other than 0 for a relative change, got an image with 0.")
        features.append(
            FeatureChange(
                feature,
                method=float(m.mean()),
                fbp=float(f.mean()),
                reference=None if g is None else float(g.mean()),
                ratio_of_means=_ratio_of_means(m, f),
                mean_of_ratios=100 * float((m / f - 1).mean()),
                interval=interval(_ratio_of_means, m, f) if different >= LEAST_CASES else None,
                closeness=_closeness(m, g, interval(_gap, f, g)) if different > 1 and g is not None else None,
            )
        )
    return TextureChange(tuple(features), spec_hash=method[0].spec_hash)


def _values(textures: Sequence[Texture], feature: str) -> NDArray[np.float64]:
    return np.array([getattr(texture, feature) for texture in textures], dtype=np.float64)


def _ratio_of_means(m: NDArray[np.float64], f: NDArray[np.float64]) -> float:
    return 100 * float(m.mean() / f.mean() - 1)


def _gap(f: NDArray[np.float64], g: NDArray[np.float64]) -> float:
    return float(f.mean() - g.mean())


def _closeness(m: NDArray[np.float64], g: NDArray[np.float64], gap: Interval) -> float | None:
    if abs(gap.estimate) <= 2 * gap.standard_error:
        return None
    return 1 - abs(_gap(m, g)) / abs(gap.estimate)


def _check_alike(method: Sequence[Texture], fbp: Sequence[Texture], reference: Sequence[Texture] | None) -> None:
    if not method:
        raise ValueError("A change of texture needs at least one image, got none.")
    for name, others in (("FBP", fbp), ("the reference", reference)):
        if others is None:
            continue
        if len(others) != len(method):
            raise ValueError(f"The method and {name} must have the same images, got {len(method)} and {len(others)}.")
        if any(one.patches != other.patches for one, other in zip(method, others, strict=True)):
            raise ValueError(f"The method and {name} were measured on different patches; measure both on the same.")
    hashes = sorted({texture.spec_hash for texture in (*method, *fbp, *(reference or ()))})
    if len(hashes) > 1:
        raise ValueError(f"Textures of different definitions cannot be compared, got the hashes {', '.join(hashes)}.")
