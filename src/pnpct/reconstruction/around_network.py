"""What plug-and-play puts around a network: mirrors, a little total variation, and the mean of two mirrors."""

import itertools
from collections.abc import Sequence

from torch import Tensor

from pnpct.arrays import Image
from pnpct.denoisers import AcrossSlices, Denoise, LearnedDenoiser, TotalVariation

MIRRORS: tuple[tuple[int, ...], ...] = ((), (-2,), (-2, -1), (-1,))
"""The axes along which the image is mirrored, from one iteration to the next."""

LITTLE = 0.002
"""Strength of total variation behind a network, image × pixel: a disc of three pixels loses 1.3 HU."""

COARSE_MM = 1.0
"""Pixel spacing up to which the strength grows as the area of a pixel falls, mm: in smaller pixels noise is coarser."""

MOST = 5.0
"""What it grows to, over `LITTLE`: then a disc of 3 mm loses 6 HU in pixels of 0.4 mm."""

MIRRORS_IN_IMAGE = 2
"""Iterates whose mean is the image: what a network makes of noise is another in each."""

_TOLERANCE = 2e-4


def around_network(denoise: Denoise, spacing: float) -> Denoise:
    """Return the denoiser of one loop around a network; other denoisers stay as they are.

    A network is the proximal map of no function, and makes curls and mottle that the loop feeds back to it. It makes
    others where it sees the image mirrored, so it sees it another way in each iteration: what mirrors do not share does
    not build up. And what mottle it leaves is coarse and faint, where total variation is at its best; in small pixels
    it is coarser yet, counted in pixels, and there is more of it.

    Args:
        denoise: The denoiser; a network, perhaps across slices.
        spacing: Of the pixels, mm.

    References:
        Terris, Moreau, Pustelnik and Tachella, CVPR (2024) 25255: equivariant plug-and-play.
    """
    network = _network_in(denoise)
    if network is None:
        return denoise
    # A map of noise levels belongs to the pixels as they are.
    return mirrored(denoise, spacing, ((),) if isinstance(network.noise_level, Tensor) else MIRRORS)


def mirrored(denoise: Denoise, spacing: float, mirrors: Sequence[tuple[int, ...]] = MIRRORS) -> Denoise:
    """Return a denoiser that sees the image mirrored another way each time, with a little total variation behind it.

    What total variation takes away has no gradient.

    Args:
        denoise: The denoiser.
        spacing: Of the pixels, mm.
        mirrors: The axes along which the image is mirrored, in turn.
    """
    flat = TotalVariation(strength_behind(spacing), tolerance=_TOLERANCE)
    turns = itertools.cycle(mirrors)

    def denoise_mirrored(image: Image) -> Image:
        axes = next(turns)
        denoised = denoise(image.flip(axes)).flip(axes)
        flattened = flat(denoised)
        return denoised + (flattened - denoised).detach() if denoised.requires_grad else flattened

    return denoise_mirrored


def strength_behind(spacing: float) -> float:
    """Return the strength of total variation behind a network in pixels of a spacing in mm, image × pixel."""
    return LITTLE * min(max((COARSE_MM / spacing) ** 2, 1.0), MOST)


def iterates_in_image(denoise: Denoise) -> int:
    """Return of how many of the last iterates the image is the mean: of one, the last, unless there is a network."""
    return 1 if _network_in(denoise) is None else MIRRORS_IN_IMAGE


def _network_in(denoise: Denoise) -> LearnedDenoiser | None:
    inner = denoise.denoise if isinstance(denoise, AcrossSlices) else denoise
    return inner if isinstance(inner, LearnedDenoiser) else None
