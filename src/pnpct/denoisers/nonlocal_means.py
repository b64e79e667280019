"""Non-local means: an average over pixels with similar surroundings."""

import math
from dataclasses import dataclass

import numpy as np
import skimage
import torch

from pnpct.arrays import Image


@dataclass(frozen=True)
class NonlocalMeans:
    """Average every pixel with nearby pixels that have similar patches, slice by slice.

    v(i) = Σ_j w_ij z(j) / Σ_j w_ij,   w_ij = exp(−max(d²_ij − 2σ², 0) / (cutoff · σ)²),

    where d²_ij is the mean squared difference of the patches around i and j and σ = `strength`. The work is
    done by scikit-image on the CPU, whatever the device of the image. Not differentiable.

    Args:
        strength: Standard deviation σ ≥ 0 of the noise in units of the image: 0.03 is 30 HU. 0 leaves the
            image as it is.
        patch: Side of the patches in pixels, at least 1.
        distance: Half width of the search window around a pixel, pixels, at least 1.
        cutoff: Decay of the weights relative to σ, positive; larger is smoother.

    Raises:
        ValueError: If a number is out of range.

    References:
        Buades, Coll and Morel, CVPR 2005; Darbon et al., ISBI 2008 (the fast form, with box patches).

    Example:
        >>> NonlocalMeans(strength=0.03)(torch.ones(16, 16)).shape
        torch.Size([16, 16])
    """

    strength: float
    patch: int = 5
    distance: int = 6
    cutoff: float = 0.8

    def __post_init__(self) -> None:
        if not (math.isfinite(self.strength) and self.strength >= 0):
            raise ValueError(f"Non-local means need a noise s.d. from 0 up, got {self.strength}.")
        if self.patch < 1 or self.distance < 1:
            raise ValueError(
                f"Non-local means need a patch and a distance of at least one pixel, got {self.patch} and "
                f"{self.distance}."
            )
        if not self.cutoff > 0:
            raise ValueError(f"The cutoff of non-local means must be positive, got {self.cutoff}.")

    @torch.no_grad()
    def __call__(self, image: Image) -> Image:
        """Return the denoised image, of the image's shape, type and device."""
        if self.strength == 0:
            return image.clone()
        slices = image.reshape(-1, *image.shape[-2:]).double().cpu().numpy()
        denoised = [
            skimage.restoration.denoise_nl_means(
                one,
                patch_size=self.patch,
                patch_distance=self.distance,
                h=self.cutoff * self.strength,
                sigma=self.strength,
                fast_mode=True,
            )
            for one in slices
        ]
        return torch.from_numpy(np.stack(denoised)).to(image).reshape(image.shape)
