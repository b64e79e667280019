"""PSNR and SSIM exactly as two published benchmarks compute them, to stand beside their tables.

The order of methods can change with window and range, so these numbers compare with those tables only, and only on
the same data. To judge an image use `psnr` and `ssim` with a window of its anatomy.
"""

import math
from collections.abc import Callable
from typing import Literal, TypeAlias

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray
from skimage.metrics import structural_similarity
from torch import Tensor

from pnpct.arrays import Image
from pnpct.evaluation.image.errors import checked_hu

Exam: TypeAlias = Literal["chest", "abdomen", "head"]

_LDCTBENCH: dict[str, tuple[float, float]] = {"chest": (-600.0, 1500.0), "abdomen": (50.0, 400.0), "head": (40.0, 80.0)}
"""Level and width, HU."""

_LODOPAB_WATER, _LODOPAB_AIR = 20.0, 0.02  # 1/m
_LODOPAB_LARGEST = _LODOPAB_WATER + 3.071 * (_LODOPAB_WATER - _LODOPAB_AIR)  # 81.35858 1/m, at 3071 HU

_Array: TypeAlias = NDArray[np.float64]
_Score: TypeAlias = Callable[[_Array, _Array, float], float]

_structural_similarity: Callable[..., float] = structural_similarity  # scikit-image has no types for it


def psnr_ldctbench(image: Image, reference: Float[Tensor, "..."], *, exam: Exam) -> float:
    """Return the PSNR of ldct-benchmark, dB: in the exam's window, whole slices, averaged over the slices.

    The window is DICOM's, from level − width/2 to level + width/2 − 1, scaled to 0 ... 1; then the score is
    10 log₁₀(1 / mean error²).

    Args:
        image: Attenuation relative to water.
        reference: The scan at full dose, of the same shape.
        exam: Its window: chest −600/1500, abdomen 50/400, head 40/80 HU.

    Raises:
        ValueError: If the shapes differ or a number is not finite.

    References:
        Eulig et al., Med. Phys. 51 (2024) 8776, doi 10.1002/mp.17379, and its program ldct-benchmark.
    """
    return _over_slices(_psnr, *_ldctbench(image, reference, exam), lambda _: 1.0)


def ssim_ldctbench(image: Image, reference: Float[Tensor, "..."], *, exam: Exam) -> float:
    """Return the SSIM of ldct-benchmark: as `psnr_ldctbench`, on 7 × 7 pixels of equal weight."""
    return _over_slices(_ssim, *_ldctbench(image, reference, exam), lambda _: 1.0)


def psnr_lodopab(image: Image, reference: Float[Tensor, "..."]) -> float:
    """Return the PSNR of LoDoPaB-CT, dB: the range is that of each reference, averaged over the slices.

    Values are (20 + 19.98 HU/1000) / 81.35858, attenuation over the largest there is; the reference is clipped to
    0 ... 1, as the data set's are, and the image is not.

    Args:
        image: Attenuation relative to water.
        reference: The ground truth, of the same shape.

    Raises:
        ValueError: If the shapes differ, a number is not finite, or a reference is constant.

    References:
        Leuschner et al., Sci. Data 8 (2021) 109 and J. Imaging 7 (2021) 44, and its program DIVal.
    """
    return _over_slices(_psnr, *_lodopab(image, reference), _own_range)


def psnr_lodopab_fr(image: Image, reference: Float[Tensor, "..."]) -> float:
    """Return the PSNR of LoDoPaB-CT with the fixed range 1 ("PSNR-FR"), dB; otherwise as `psnr_lodopab`."""
    return _over_slices(_psnr, *_lodopab(image, reference), lambda _: 1.0)


def ssim_lodopab(image: Image, reference: Float[Tensor, "..."]) -> float:
    """Return the SSIM of LoDoPaB-CT: as `psnr_lodopab`, on 7 × 7 pixels of equal weight."""
    return _over_slices(_ssim, *_lodopab(image, reference), _own_range)


def ssim_lodopab_fr(image: Image, reference: Float[Tensor, "..."]) -> float:
    """Return the SSIM of LoDoPaB-CT with the fixed range 1 ("SSIM-FR"); otherwise as `ssim_lodopab`."""
    return _over_slices(_ssim, *_lodopab(image, reference), lambda _: 1.0)


def _ldctbench(image: Tensor, reference: Tensor, exam: Exam) -> tuple[_Array, _Array]:
    if exam not in _LDCTBENCH:
        raise ValueError(f'The exam is "chest", "abdomen" or "head", got "{exam}".')
    level, width = _LDCTBENCH[exam]
    scaled = (((hu - (level - 0.5)) / (width - 1) + 0.5).clamp(0, 1) for hu in checked_hu(image, reference))
    a, b = map(_slices, scaled)
    return a, b


def _lodopab(image: Tensor, reference: Tensor) -> tuple[_Array, _Array]:
    a, b = (
        _slices((_LODOPAB_WATER + (_LODOPAB_WATER - _LODOPAB_AIR) * hu / 1000) / _LODOPAB_LARGEST)
        for hu in checked_hu(image, reference)
    )
    return a, b.clip(0, 1)


def _slices(images: Tensor) -> _Array:
    return images.reshape(-1, *images.shape[-2:]).cpu().numpy()


def _own_range(reference: _Array) -> float:
    found = float(np.ptp(reference))
    if found == 0:
        raise ValueError("A reference that is constant has no range; the score needs one with contrast.")
    return found


def _over_slices(score: _Score, images: _Array, references: _Array, data_range: Callable[[_Array], float]) -> float:
    pairs = zip(images, references, strict=True)
    return float(np.mean([score(image, reference, data_range(reference)) for image, reference in pairs]))


def _psnr(image: _Array, reference: _Array, data_range: float) -> float:
    error = float(np.square(image - reference).mean())
    return 10 * math.log10(data_range**2 / error) if error > 0 else math.inf


def _ssim(image: _Array, reference: _Array, data_range: float) -> float:
    if min(image.shape) < 7:
        raise ValueError(f"Structural similarity needs images of at least 7 x 7 pixels, got {image.shape}.")
    return float(_structural_similarity(reference, image, data_range=data_range))
