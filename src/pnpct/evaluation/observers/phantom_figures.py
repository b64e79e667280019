"""Noise, sharpness and detectability from images of a phantom, together."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Float
from torch import Tensor

from pnpct.evaluation.image.patches import patches_in_square
from pnpct.evaluation.observers.eye_filter import EyeFilter
from pnpct.evaluation.observers.matched_filter import matched_filter_d_prime
from pnpct.evaluation.observers.model_observers import Detectability, channelised_hotelling
from pnpct.evaluation.observers.noise_power import NoisePower, noise_power_of_one, noise_power_of_repeats
from pnpct.evaluation.observers.task_transfer import TaskTransfer, task_transfer
from pnpct.geometry import ImageGrid


@dataclass(frozen=True, eq=False)
class PhantomFigures:
    """What images of a phantom show.

    Args:
        power: Noise power in the uniform region.
        transfer: Transfer of the disc; None if none was given.
        values: The numbers, by names that end in their units.
    """

    power: NoisePower
    transfer: TaskTransfer | None
    values: Mapping[str, float]

    @property
    def finite(self) -> dict[str, float | None]:
        """The numbers, None for infinity and what is no number, which JSON does not know."""
        return {name: value if math.isfinite(value) else None for name, value in self.values.items()}


def measure_phantom(
    images: Float[Tensor, "repeats rows cols"],
    grid: ImageGrid,
    *,
    uniform: tuple[float, float, float],
    disc: tuple[float, float, float] | None = None,
    lesion: tuple[float, float] | None = None,
    insert: tuple[float, float, float] | None = None,
    generator: np.random.Generator | None = None,
) -> PhantomFigures:
    """Measure noise power; of a disc the transfer and d′ of a matched filter; of an insert d′ of a Hotelling observer.

    Args:
        images: Repeated scans of one phantom, attenuation relative to water; of a single one the noise power is that
            around a polynomial of second order.
        grid: Where the pixels are.
        uniform: Middle x, y and side of a square where the phantom is uniform, mm.
        disc: Middle x, y and diameter of a disc, mm, uniform within and around.
        lesion: Contrast, HU, and diameter, mm, of a disc to find; needs `disc`, of about that contrast.
        insert: Middle x, y and diameter of an insert of low contrast, mm. The channelised Hotelling observer tells it
            from the middle of the uniform region, where the noise should be the same; it needs 40 images or more.
        generator: Source of that observer's splits and resamples; needed with `insert`.

    Raises:
        ValueError: If a region is not in the image or too small, the disc stands out too little from the noise, there
            are too few images for an insert, or a lesion is given without a disc.
    """
    if lesion is not None and disc is None:
        raise ValueError("Detectability of a lesion needs the transfer of a disc; give the place of one as well.")
    patches, size = patches_in_square(grid, center=uniform[:2], side=uniform[2])
    if len(images) > 1:
        power = noise_power_of_repeats(images, spacing=grid.spacing, size=size, patches=patches)
    else:
        power = noise_power_of_one(images[0], spacing=grid.spacing, size=size, patches=patches)
    rings = power.radial()
    values = {
        "noise_hu": math.sqrt(power.variance),
        "mean_frequency_per_mm": rings.mean_frequency,
        "peak_frequency_per_mm": rings.peak_frequency,
    }
    if insert is not None:
        if generator is None:
            raise ValueError("Splits and resamples for an insert need a generator of random numbers.")
        found = _found(images, grid, insert, uniform[:2], generator).d_prime
        values |= {"d_prime_cho": found.estimate, "d_prime_cho_low": found.low, "d_prime_cho_high": found.high}
    if disc is None:
        return PhantomFigures(power, None, values)
    transfer = task_transfer(images, grid=grid, center=disc[:2], radius=disc[2] / 2)
    values |= {
        "contrast_hu": transfer.contrast_hu,
        "contrast_to_noise": transfer.contrast_to_noise,
        "f50_per_mm": transfer.f50,
        "f10_per_mm": transfer.f10,
    }
    if lesion is not None:
        d_prime = partial(matched_filter_d_prime, power, transfer, contrast_hu=lesion[0], diameter=lesion[1])
        values |= {"d_prime_npw": d_prime(), "d_prime_npwe": d_prime(eye=EyeFilter())}
    return PhantomFigures(power, transfer, values)


def _found(
    images: Float[Tensor, "repeats rows cols"],
    grid: ImageGrid,
    insert: tuple[float, float, float],
    absent_at: tuple[float, float],
    generator: np.random.Generator,
) -> Detectability:
    """How well the channelised Hotelling observer tells an insert from a uniform place."""
    x, y, diameter = insert
    (present, absent), size = zip(
        *(
            patches_in_square(grid, center=center, side=2 * diameter, size=max(grid.shape))
            for center in ((x, y), absent_at)
        ),
        strict=True,
    )
    cuts = [images[:, at.row : at.row + size[0], at.col : at.col + size[0]] for (at,) in (present, absent)]
    return channelised_hotelling(cuts[0], cuts[1], spacing=grid.spacing, diameter=diameter, generator=generator)
