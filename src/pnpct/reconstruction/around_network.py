"""What plug-and-play puts around a network: mirrors, and a little total variation."""

import itertools

from torch import Tensor

from pnpct.arrays import Image
from pnpct.denoisers import AcrossSlices, Denoise, LearnedDenoiser
from pnpct.reconstruction.starting import proximal_total_variation

MIRRORS: tuple[tuple[int, ...], ...] = ((), (-2,), (-2, -1), (-1,))
"""The axes along which the image is mirrored, from one iteration to the next."""

LITTLE = 0.1
"""Strength of total variation behind a network, pixels: a fifteenth of that of TV-PWLS."""


def around_network(denoise: Denoise, *, sigma_v: float, noise: Tensor) -> Denoise:
    """Return the denoiser of one loop around a network; other denoisers stay as they are.

    A network is the proximal map of no function, and makes curls and mottle that the loop feeds back to it. It makes
    others where it sees the image mirrored, so it sees it another way in each iteration: what mirrors do not share does
    not build up. And what mottle it leaves is coarse and faint, where total variation is at its best: λ = `LITTLE` / σ,
    with σ the standard deviation to which the data alone determine a pixel.

    Args:
        denoise: The denoiser; a network, perhaps across slices.
        sigma_v: What σ_v ends with, HU.
        noise: σ of each image, HU, by `balanced_sigma_v`.

    References:
        Terris, Moreau, Pustelnik and Tachella, CVPR (2024) 25255: equivariant plug-and-play.
    """
    network = denoise.denoise if isinstance(denoise, AcrossSlices) else denoise
    if not isinstance(network, LearnedDenoiser):
        return denoise
    flat = proximal_total_variation(LITTLE, noise.new_tensor(sigma_v), noise)
    # A map of noise levels belongs to the pixels as they are.
    mirrors = itertools.cycle([()] if isinstance(network.noise_level, Tensor) else MIRRORS)

    def mirrored(image: Image) -> Image:
        axes = next(mirrors)
        return flat(denoise(image.flip(axes)).flip(axes))

    return mirrored
