"""Images that a denoiser learns from: those of FBP, and those that the loop of ADMM gives it."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import islice
from typing import Any, Protocol, runtime_checkable

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from pnpct.arrays import Image
from pnpct.denoisers import Denoise, TotalVariation
from pnpct.geometry import FanBeam, ImageGrid
from pnpct.operators import Kernel, Projector
from pnpct.physics import Scan, take_log
from pnpct.reconstruction import PlugAndPlay, corrected_for_bone, fbp, starting_state
from pnpct.reconstruction.around_network import around_network

SIGMAS_V = (40.0, 90.0)
"""Lowest and highest σ_v, HU, between which it is drawn evenly in its logarithm: around the default."""

STRENGTHS_HU = (10.0, 60.0)
"""Lowest and highest strength of total variation, HU × pixel, drawn likewise."""

TV_ITERATIONS = 20
"""Iterations of total variation in the loop."""

LEAST_VIEWS = 30
"""Least views in a subset of a scan; FBP takes steps between views of 15 degrees and more for gaps."""


@runtime_checkable
class MakeImages(Protocol):
    """From a scan to an image on a grid, or to several, with random settings where there are any."""

    @property
    def settings(self) -> Mapping[str, Any]:
        """What makes the images: its name and numbers, as plain values."""
        ...

    def __call__(
        self, scan: Scan, grid: ImageGrid, generator: torch.Generator, /
    ) -> Float[Tensor, "*images rows cols"]:
        """Return the image, or several."""
        ...


@dataclass(frozen=True)
class FBPImages:
    """Images of filtered back-projection; the sharpest kernel leaves all the noise.

    Args:
        kernel: Filter of FBP.
    """

    kernel: Kernel = "ram-lak"

    @property
    def settings(self) -> dict[str, Any]:
        """What makes the images, as plain values."""
        return {"images": "fbp", "kernel": self.kernel}

    def __call__(
        self, scan: Scan, grid: ImageGrid, _: torch.Generator | None = None, /
    ) -> Float[Tensor, "*slices rows cols"]:
        """Return the image of a scan."""
        A = kept_projector(grid, scan.geometry, scan.mu_water)
        return fbp(corrected_for_bone(take_log(scan), A).line_integrals, A, kernel=self.kernel)


def view_subset_images(scan: Scan, grid: ImageGrid, parts: int) -> Float[Tensor, "parts *slices rows cols"]:
    """Divide the views of a scan into interleaved subsets, and return the FBP image of each.

    The mean of the images is the FBP image of all views where the subsets divide a full rotation evenly and counts
    suffice. Each subset takes its own logarithm, since that of starved rays uses neighbouring views (`take_log`):
    no subset depends on a count of another.

    Args:
        scan: The scan, of one slice or of several.
        grid: Where the pixels are.
        parts: Number of subsets, at least 2.

    Raises:
        ValueError: If there are fewer subsets, or too few views for them.
    """
    if parts < 2:
        raise ValueError(f"The views of a scan are divided into at least two parts, got {parts}.")
    if (views := scan.geometry.views) < LEAST_VIEWS * parts:
        raise ValueError(f"{parts} parts of at least {LEAST_VIEWS} views each cannot be made of {views} views.")
    return torch.stack([FBPImages()(scan[first::parts], grid) for first in range(parts)])


@dataclass(frozen=True)
class LoopImages:
    """What the denoiser gets in some of the first iterations of ADMM, x + u, with noise of another colour than FBP's.

    Args:
        denoiser: Denoiser of the iterations before; total variation of random strength if None.
        name: What the denoiser is, such as the SHA-256 of a network; it stands for the denoiser in `settings`.
        iterations: Maximum number of iterations, ≥ 1.
        number: In how many of them, from 1 to all. Each image costs the iterations before it, so several cost little
            more than one.

    Raises:
        ValueError: If there is no iteration, or more images than iterations.
    """

    denoiser: Denoise | None = field(default=None, repr=False)
    name: str = "tv"
    iterations: int = 3
    number: int = 1

    def __post_init__(self) -> None:
        if self.iterations < 1:
            raise ValueError(f"The loop needs at least one iteration, got {self.iterations}.")
        if not 1 <= self.number <= self.iterations:
            raise ValueError(f"{self.iterations} iterations give 1 to {self.iterations} images, not {self.number}.")

    @property
    def settings(self) -> dict[str, Any]:
        """What makes the images, as plain values."""
        loop = {"iterations": self.iterations, "number": self.number, "sigmas_v_hu": list(SIGMAS_V)}
        tv = {} if self.denoiser else {"strengths_hu": list(STRENGTHS_HU), "tv_iterations": TV_ITERATIONS}
        return {"images": "loop", "denoiser": self.name, **loop, **tv}

    def undisturbed(self) -> "LoopImages":
        """Return the loop with a denoiser that changes nothing: for references of a scan without noise."""
        return replace(self, denoiser=_unchanged, name="none")

    def __call__(
        self, scan: Scan, grid: ImageGrid, generator: torch.Generator, /
    ) -> Float[Tensor, "number *slices rows cols"]:
        """Return the images of iterations and for a σ_v that are drawn."""
        A = kept_projector(grid, scan.geometry, scan.mu_water)
        sinogram = corrected_for_bone(take_log(scan), A)
        strength = _evenly_in_logarithm(*STRENGTHS_HU, generator) / 1000
        # As plug-and-play has it, which does not see that there is a network in `watched`.
        denoise = around_network(self.denoiser or TotalVariation(strength, iterations=TV_ITERATIONS), grid.spacing)
        sigma_v = _evenly_in_logarithm(*SIGMAS_V, generator)
        chosen = torch.randperm(self.iterations, generator=generator)[: self.number].sort().values.tolist()
        shown: list[Image] = []

        def watched(image: Image) -> Image:
            shown.append(image)
            return denoise(image) if len(shown) <= chosen[-1] else image

        start = starting_state(sinogram, A)
        for _ in islice(PlugAndPlay(watched, sigma_v=sigma_v).states(sinogram, A, start), chosen[-1] + 1):
            pass
        return torch.stack([shown[iteration] for iteration in chosen])


def _unchanged(image: Image) -> Image:
    return image


def _evenly_in_logarithm(low: float, high: float, generator: torch.Generator) -> float:
    share = float(torch.rand((), generator=generator))
    return float(np.exp((1 - share) * np.log(low) + share * np.log(high)))


@lru_cache(maxsize=8)
def kept_projector(grid: ImageGrid, geometry: FanBeam, mu_water: float) -> Projector:
    """Return a projector: it takes longer to make than to use, and a data set has few."""
    return Projector(grid, geometry, mu_water=mu_water)
