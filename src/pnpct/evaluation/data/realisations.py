"""Other data that the same scan could have given: noise drawn anew, and half of the views."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TypeAlias

import torch

from pnpct.arrays import Image, Rays
from pnpct.geometry.short_repr import short_repr
from pnpct.operators import Projector
from pnpct.physics import DiagonalWeights, Sinogram

Reconstruct: TypeAlias = Callable[[Sinogram], Image]
"""A reconstruction with all its settings inside."""


@dataclass(frozen=True, eq=False)
class Realisation:
    """One draw of the data, and what was reconstructed from it.

    Args:
        sinogram: Line integrals with new noise, and the weights of the scan.
        image: Attenuation relative to water.
    """

    sinogram: Sinogram
    image: Image

    __repr__ = short_repr


@dataclass(frozen=True, eq=False)
class HalfScan:
    """Every second view of a scan.

    Args:
        sinogram: Their line integrals and weights.
        projector: Where their rays are.
    """

    sinogram: Sinogram
    projector: Projector


def ray_weights(sinogram: Sinogram) -> Rays:
    """Return 1/variance of each ray.

    Raises:
        ValueError: If the noise of the rays is correlated, or they are not corrected for bone yet.
    """
    check_corrected(sinogram)
    if not isinstance(sinogram.weights, DiagonalWeights):
        raise ValueError(
            "Data can be redrawn, split and changed for rays of independent noise only; take DiagonalWeights for the "
            "test, got BandedWeights."
        )
    return sinogram.weights.values


def check_corrected(sinogram: Sinogram) -> None:
    """Check that methods take line integrals as they are, so that images can be compared with them.

    Raises:
        ValueError: If they are not corrected for bone yet.
    """
    if sinogram.bone is not None:
        raise ValueError(
            "Methods would correct these line integrals for bone; give what `corrected_for_bone(sinogram, A)` returns, "
            "to them and to the test."
        )


def redraw(sinogram: Sinogram, line_integrals: Rays, *, generator: torch.Generator) -> Sinogram:
    """Draw noise anew around given line integrals: y ~ Normal(p, 1/weights).

    It is as good as the weights. What is not Gaussian in the logarithm of a few quanta is missing; where the object
    is known, draw counts instead (`simulate_counts`, `scan_from_moments`). Rays of weight 0 get no noise.

    Args:
        sinogram: Says what the rays are worth; its weights must be inverse variances, as those of `take_log` are.
        line_integrals: p, without noise, say the projection of an image.
        generator: Source of the noise, on the device of the line integrals.

    Returns:
        Noisy line integrals with the same weights.

    Raises:
        ValueError: If the noise of the rays is correlated, or the line integrals are for other rays.
    """
    weights = ray_weights(sinogram).to(line_integrals)
    deviation = torch.where(weights > 0, weights, torch.inf).rsqrt()
    noise = torch.randn(
        line_integrals.shape, generator=generator, dtype=line_integrals.dtype, device=line_integrals.device
    )
    return Sinogram(line_integrals + deviation * noise, sinogram.weights)


def parametric_bootstrap(
    reconstruct: Reconstruct,
    image: Image,
    sinogram: Sinogram,
    projector: Projector,
    *,
    realisations: int,
    generator: torch.Generator,
) -> Iterator[Realisation]:
    """Yield what the same reconstruction would have given, had the image been the object.

        y* ~ Normal(A image, 1/weights),     x* = reconstruct(y*)

    Args:
        reconstruct: The reconstruction that made the image.
        image: The image that stands for the object.
        sinogram: The data that it was made from; only the weights are used.
        projector: A.
        realisations: How many, at least 1; each costs a reconstruction.
        generator: Source of the noise, on the device of the image.

    Yields:
        Data and image of each realisation.

    Raises:
        ValueError: If there is no realisation to draw, or the noise of the rays is correlated.

    References:
        Efron and Tibshirani, An Introduction to the Bootstrap (1993), section 6.5.
    """
    if realisations < 1:
        raise ValueError(f"A bootstrap needs at least one realisation, got {realisations}.")
    line_integrals = projector(image)
    for _ in range(realisations):
        drawn = redraw(sinogram, line_integrals, generator=generator)
        yield Realisation(drawn, reconstruct(drawn))


def split_views(sinogram: Sinogram, projector: Projector) -> tuple[HalfScan, HalfScan]:
    """Return the even and the odd views, in the order of the scan: two scans with independent noise.

    Args:
        sinogram: The data.
        projector: Where the rays are.

    Raises:
        ValueError: If there are fewer than two views, or the noise of the rays is correlated.
    """
    geometry = projector.geometry
    if geometry.views < 2:
        raise ValueError(f"Only two views or more can be split, got {geometry.views}.")
    weights = ray_weights(sinogram)

    def half(first: int) -> HalfScan:
        part = geometry[first::2]
        return HalfScan(
            Sinogram(sinogram.line_integrals[..., first::2, :], DiagonalWeights(weights[..., first::2, :])),
            Projector(projector.grid, part, mu_water=projector.mu_water, method=projector.method),
        )

    return half(0), half(1)
