"""The images that a denoiser learns from: those of FBP, and those that ADMM shows it."""

from dataclasses import dataclass, field
from functools import lru_cache
from itertools import islice

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from pnpct.arrays import Image
from pnpct.denoisers import Denoise, TotalVariation
from pnpct.geometry import FanBeam, ImageGrid
from pnpct.operators import Projector
from pnpct.physics import Scan, take_log
from pnpct.reconstruction import ADMMState, fbp, pnp_admm

BETAS = (0.7, 1.5)
"""Lowest and highest penalty, between which it is drawn evenly in its logarithm: around the default.

The noise of u goes with 1/β. When it was drawn from 0.3 on, x + u of a head at 23 mA was 1300 HU from the reference,
ten times as far as FBP, and training on such images diverged.
"""

STRENGTHS_HU = (15.0, 120.0)
"""Lowest and highest strength of total variation, HU × pixel, drawn likewise."""


QUIET_MA = 1e6
"""Tube current of a scan with next to no noise, mA: 1 HU in an FBP image."""

LEAST_VIEWS = 30
"""Views of a part of a scan; FBP takes views of a turn that are farther apart, from 15 degrees on, for gaps."""


def fbp_image(scan: Scan, grid: ImageGrid, _: torch.Generator | None = None) -> Image:
    """Return the sharpest image, with all its noise."""
    return fbp(take_log(scan).line_integrals, _projector(grid, scan.geometry, scan.mu_water), kernel="ram-lak")


def view_subset_images(scan: Scan, grid: ImageGrid, parts: int) -> Float[Tensor, "parts *slices rows cols"]:
    """Deal the views of a scan out to parts in turn, and return the FBP image of each part.

    The mean of the images is the FBP image of all views where the parts divide a full turn evenly and counts
    suffice. Each part takes its own logarithm, since that of starved rays looks at neighbouring views (`take_log`):
    no part knows a count of another.

    Args:
        scan: What was measured, of one slice or of several.
        grid: Where the pixels are.
        parts: How many, at least 2.

    Raises:
        ValueError: If there are fewer parts, or too few views for them.
    """
    if parts < 2:
        raise ValueError(f"The views of a scan are dealt out to at least two parts, got {parts}.")
    if (views := scan.geometry.views) < LEAST_VIEWS * parts:
        raise ValueError(f"{parts} parts of at least {LEAST_VIEWS} views each cannot be made of {views} views.")
    return torch.stack([fbp_image(scan[first::parts], grid) for first in range(parts)])


@dataclass(frozen=True)
class LoopImages:
    """What the denoiser gets in some of the first iterations of ADMM, x + u, whose noise has another colour than FBP's.

    Args:
        denoiser: What denoised in the iterations before; total variation of random strength if None. With `unchanged`
            and a quiet scan: what an iteration shows without noise.
        name: What the denoiser is, for telling images apart.
        iterations: Most iterations, ≥ 1.
        number: In how many of them, from 1 to all. Each image costs the iterations before it, so several cost little
            more than one.
        damping: Share of the dual variable that each iteration forgets: what the reconstruction has around the same
            denoiser.
    """

    denoiser: Denoise | None = field(default=None, repr=False)
    name: str = "tv"
    iterations: int = 3
    number: int = 1
    damping: float = 0.0

    def __call__(
        self, scan: Scan, grid: ImageGrid, generator: torch.Generator
    ) -> Float[Tensor, "number *slices rows cols"]:
        """Return the images of iterations and for a penalty β that are drawn."""
        A = _projector(grid, scan.geometry, scan.mu_water)
        sinogram = take_log(scan)
        strength = _evenly_in_logarithm(*STRENGTHS_HU, generator) / 1000
        denoise = self.denoiser or TotalVariation(strength, iterations=20)
        beta = _evenly_in_logarithm(*BETAS, generator)
        chosen = torch.randperm(self.iterations, generator=generator)[: self.number].sort().values.tolist()
        shown: list[Image] = []

        def watched(image: Image) -> Image:
            shown.append(image)
            return denoise(image) if len(shown) <= chosen[-1] else image

        start = ADMMState.start(fbp(sinogram.line_integrals, A, kernel="soft"))
        for _ in islice(pnp_admm(sinogram, A, watched, start, beta=beta, damping=self.damping), chosen[-1] + 1):
            pass
        return torch.stack([shown[iteration] for iteration in chosen])


def unchanged(image: Image) -> Image:
    """Denoise what has no noise."""
    return image


def _evenly_in_logarithm(low: float, high: float, generator: torch.Generator) -> float:
    share = float(torch.rand((), generator=generator))
    return float(np.exp((1 - share) * np.log(low) + share * np.log(high)))


@lru_cache(maxsize=8)
def _projector(grid: ImageGrid, geometry: FanBeam, mu_water: float) -> Projector:
    """A projector takes longer to make than to use, and a data set has few."""
    return Projector(grid, geometry, mu_water=mu_water)
