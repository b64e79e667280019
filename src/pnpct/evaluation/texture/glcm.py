"""Texture of soft tissue: features of gray-level co-occurrence matrices on fixed patches in a fixed window."""

import hashlib
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np
import torch
from jaxtyping import Float
from numpy.typing import NDArray
from scipy import ndimage
from skimage import feature
from torch import Tensor

from pnpct.evaluation.image.hounsfield import check_window, hu_array
from pnpct.evaluation.image.patches import Patch, patch_values, tile_patches
from pnpct.evaluation.image.regions import body_mask
from pnpct.evaluation.texture.histogram import gray_levels
from pnpct.units import from_hu

FEATURES = ("contrast", "dissimilarity", "homogeneity", "asm", "energy", "correlation", "entropy")
"""The features of a `Texture`, in the order in which they are shown."""


_graycomatrix: Callable[..., NDArray[np.float64]] = feature.graycomatrix  # which has no types


@dataclass(frozen=True)
class GLCMSpec:
    """All that a texture feature depends on besides the image; numbers of different specs must not be compared.

    Args:
        window: Lower and upper end of the gray levels, HU; values outside fall on the end levels.
        levels: Number of gray levels, 2 to 256.
        distances: Distances of the pairs, pixels, at least 1.
        angles: Directions of the pairs, rad.
        symmetric: Whether a pair counts in both orders.
        quantisation: "fixed" has the window for all patches. "roi_minmax" stretches each patch from its lowest
            to its highest value, as some programs do: it does not see the amplitude of noise, and one outlier
            changes everything. Only to compare with numbers of such programs.
        patch: Side of the patches, pixels, at least 2; energy, ASM and entropy depend on it.
        stride: Distance between patches, pixels, at least 1.
        margin: Distance of the patches from the skin, pixels, ≥ 0.
        tissue: Lowest and highest HU value of the reference inside a patch.
        spread: Standard deviation of the reference in a patch, HU, below which it counts as one tissue.
        smoothing: Standard deviation of the Gaussian, pixels, that a noisy reference is smoothed with for the
            choice of patches, and only for it: 4 for a measured reference, 0 for a known truth.

    Raises:
        ValueError: If a number is out of its range.

    Example:
        >>> GLCMSpec().hash == GLCMSpec(window=(-120.0, 180.0)).hash != GLCMSpec(patch=32).hash
        True
    """

    window: tuple[float, float] = (-120.0, 180.0)
    levels: int = 256
    distances: tuple[int, ...] = (1,)
    angles: tuple[float, ...] = (0.0, math.pi / 4, math.pi / 2, 3 * math.pi / 4)
    symmetric: bool = True
    quantisation: Literal["fixed", "roi_minmax"] = "fixed"
    patch: int = 64
    stride: int = 64
    margin: int = 5
    tissue: tuple[float, float] = (-250.0, 350.0)
    spread: float = 60.0
    smoothing: float = 0.0

    def __post_init__(self) -> None:
        check_window(self.window)
        check_window(self.tissue)
        if not 2 <= self.levels <= 256:
            raise ValueError(f"The number of gray levels is from 2 to 256, got {self.levels}.")
        if not self.distances or not self.angles or min(self.distances) < 1 or max(self.distances) >= self.patch:
            raise ValueError(
                f"Pairs need an angle and distances from 1 to below the patch of {self.patch} pixels, got distances "
                f"{self.distances} and angles {self.angles}."
            )
        if self.stride < 1 or self.margin < 0:
            raise ValueError(f"The stride is at least 1 and the margin 0 pixels, got {self.stride} and {self.margin}.")
        if not (self.spread > 0 and 0 <= self.smoothing < math.inf):
            raise ValueError(
                f"The spread is positive and the smoothing not negative, got {self.spread} and {self.smoothing}."
            )

    @property
    def canonical_json(self) -> str:
        """The whole definition as JSON with sorted keys and no spaces, what is fixed included."""
        fixed = {
            "quantiser": "floor(clip((x-lo)/(hi-lo))*levels), top clipped to levels-1",
            "aggregate": "property per distance and angle, mean over them, then over patches, then over images",
            "entropy_base": 2,
        }
        return json.dumps({**asdict(self), **fixed}, sort_keys=True, separators=(",", ":"))

    @property
    def hash(self) -> str:
        """The first 12 hexadecimal digits of the SHA-256 of `canonical_json`."""
        return hashlib.sha256(self.canonical_json.encode()).hexdigest()[:12]


@dataclass(frozen=True)
class Texture:
    """Texture features of one image, each the mean over directions and patches.

    Args:
        contrast: Σ p (i − j)², levels squared.
        dissimilarity: Σ p |i − j|, levels.
        homogeneity: Σ p / (1 + (i − j)²), 0 to 1.
        asm: Angular second moment Σ p², 0 to 1.
        energy: √ASM of each direction, 0 to 1.
        correlation: Σ p (i − μᵢ)(j − μⱼ)/(σᵢ σⱼ) of neighbours in one image, −1 to 1; 1 for a constant.
        entropy: −Σ p log₂ p, bits.
        patches: Where it was measured.
        spec_hash: `GLCMSpec.hash` of its definition.
    """

    contrast: float
    dissimilarity: float
    homogeneity: float
    asm: float
    energy: float
    correlation: float
    entropy: float
    patches: tuple[Patch, ...]
    spec_hash: str


def texture_patches(reference: Float[Tensor, "rows cols"], *, spec: GLCMSpec = GLCMSpec()) -> tuple[Patch, ...]:
    """Choose the patches of soft tissue, by the reference alone.

    A patch counts if all of it is deeper than `spec.margin` in the body and between the limits of
    `spec.tissue`, and its standard deviation is below `spec.spread`. The same patches serve every method; no
    method has a say in where it is judged.

    Args:
        reference: The truth, attenuation relative to water; or the reference scan with `spec.smoothing` 4; or
            FBP with `spec.smoothing` 4 where there is no reference.
        spec: The definition.

    Returns:
        The patches, row by row; none where there is no such tissue.

    Raises:
        ValueError: If the image is smaller than a patch or has numbers that are not finite.
    """
    hu = hu_array(reference)
    if spec.smoothing > 0:
        hu = ndimage.gaussian_filter(hu, spec.smoothing)
    body = body_mask(from_hu(torch.from_numpy(hu))).numpy()
    offsets = np.arange(-spec.margin, spec.margin + 1)
    disc = offsets[:, None] ** 2 + offsets**2 <= spec.margin**2
    inside = ndimage.binary_erosion(body, disc, border_value=1)
    tissue = inside & (hu >= spec.tissue[0]) & (hu <= spec.tissue[1])
    shape = (hu.shape[0], hu.shape[1])

    def chosen(patch: Patch) -> bool:
        part = np.s_[patch.row : patch.row + spec.patch, patch.col : patch.col + spec.patch]
        return bool(tissue[part].all() and hu[part].std() < spec.spread)

    return tuple(filter(chosen, tile_patches(shape, size=spec.patch, stride=spec.stride)))


def texture_features(
    image: Float[Tensor, "rows cols"],
    patches: Sequence[Patch],
    *,
    spec: GLCMSpec = GLCMSpec(),
) -> Texture:
    """Measure the texture of an image on given patches.

    p(i, j) is the share of pairs of pixels at a distance and angle whose levels are i and j. The features of
    each patch, distance and angle are averaged; matrices are not, which would change energy and entropy.
    Smoother is not better: a constant image has the least contrast and the most energy. Judge by the distance
    from the reference, see `texture_change`.

    Args:
        image: Attenuation relative to water.
        patches: Where, from `texture_patches` of the reference.
        spec: The definition.

    Returns:
        The features.

    Raises:
        ValueError: If there is no patch, one reaches out of the image, or a number is not finite.

    References:
        Haralick, Shanmugam and Dinstein, IEEE Trans. Syst. Man Cybern. SMC-3 (1973) 610.
        The paper, section on evaluation: distance 1, four angles, 256 levels.

    Example:
        >>> texture = texture_features(torch.ones(64, 64), [Patch(0, 0)])
        >>> texture.contrast, texture.homogeneity, texture.energy
        (0.0, 1.0, 1.0)
    """
    features = [_glcm_features(_quantised(patch, spec), spec) for patch in patch_values(image, patches, spec.patch)]
    mean = np.mean(features, axis=0)
    return Texture(**dict(zip(FEATURES, mean.tolist(), strict=True)), patches=tuple(patches), spec_hash=spec.hash)


def _quantised(patch_hu: NDArray[np.float64], spec: GLCMSpec) -> NDArray[np.uint8]:
    window = spec.window
    if spec.quantisation == "roi_minmax":
        window = float(patch_hu.min()), float(patch_hu.max())
        if window[0] == window[1]:
            return np.zeros(patch_hu.shape, np.uint8)
    return gray_levels(patch_hu, window=window, levels=spec.levels)


def _glcm_features(levels: NDArray[np.uint8], spec: GLCMSpec) -> list[float]:
    pairs = _graycomatrix(
        levels, list(spec.distances), list(spec.angles), levels=spec.levels, symmetric=spec.symmetric, normed=True
    )
    i, j, *at = np.nonzero(pairs)  # of 256 x 256 pairs of levels a patch has a thousand
    share, matrix = pairs[i, j, *at], np.ravel_multi_index(at, pairs.shape[2:])

    def mean(values: NDArray[Any]) -> NDArray[Any]:
        """The mean over all pairs, for each distance and angle."""
        return np.bincount(matrix, share * values)

    apart, of_i, of_j = (i - j).astype(np.float64), i - mean(i)[matrix], j - mean(j)[matrix]
    asm, spread = mean(share), np.sqrt(mean(of_i**2) * mean(of_j**2))
    correlation = np.divide(mean(of_i * of_j), spread, out=np.ones_like(spread), where=spread > 0)
    features = (mean(apart**2), mean(abs(apart)), mean(1 / (1 + apart**2)), asm, np.sqrt(asm), correlation)
    return [float(each.mean()) for each in (*features, abs(mean(np.log2(share))))]
