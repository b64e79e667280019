"""Pairs of images to learn from, drawn from the exposures of a data set."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeAlias

import numpy as np
import torch

from pnpct.arrays import Image
from pnpct.files import ExposedSlice, read_exposure, tube_voltages
from pnpct.geometry import ImageGrid
from pnpct.physics import Scan
from pnpct.training.augmentation import Augmentation

REFERENCE_MA = 800.0
"""Tube current of the scans that count as high dose, mA."""

MakeImage: TypeAlias = Callable[[Scan, ImageGrid, torch.Generator], Image]
"""From a scan to an image on a grid, with random settings where there are any: FBP, or a data step of ADMM."""


@dataclass(frozen=True, eq=False)
class Pair:
    """What a denoiser gets, and what it should return.

    Args:
        input: Noisy image, relative to water.
        target: Image of the same slice, with independent noise.
    """

    input: Image
    target: Image


@dataclass(frozen=True, eq=False)
class Pairs:
    """Pairs by number: the same number is the same pair, whoever asks, in whatever order.

    The slice, the tube voltage and the tube currents (evenly in their logarithm) are drawn for each pair.

    Args:
        files: Files of exposures.
        images: Ways to make an image of a scan, of which one is drawn for each pair.
        kind: "noisy" pairs are two low-dose scans, either of which may be the input (criss-cross); in "dose" pairs
            the target is a scan at 800 mA, made by the first of `images`.
        seed: Of everything that is drawn.
        tube_currents_ma: Lowest and highest tube current of low-dose scans, mA.
        augment: Whether pairs are mirrored, turned, moved and scaled at random.

    Raises:
        ValueError: If there are no files or ways to make images, or the currents are not positive and rising.
    """

    files: Sequence[Path]
    images: Sequence[MakeImage]
    kind: Literal["noisy", "dose"]
    seed: int
    tube_currents_ma: tuple[float, float] = (20.0, 200.0)
    augment: bool = True

    def __post_init__(self) -> None:
        low, high = self.tube_currents_ma
        if not (self.files and self.images):
            raise ValueError("Pairs are drawn from at least one file, with at least one way to make images.")
        if not 0 < low <= high < math.inf:
            raise ValueError(f"Tube currents are positive and rising, in mA, got {low} and {high}.")

    def __call__(self, number: int) -> Pair:
        """Draw the pair of a number, from 0 on."""
        draw = np.random.default_rng([self.seed, number])
        generator = torch.Generator().manual_seed(int(draw.integers(2**62)))
        path = self.files[int(draw.integers(len(self.files)))]
        voltages = tube_voltages(path)
        exposed = read_exposure(path, tube_voltage_kvp=voltages[int(draw.integers(len(voltages)))])
        make = self.images[int(draw.integers(len(self.images)))]
        low = self._image(exposed, self._current(draw), make, generator)
        if self.kind == "dose":
            pair = Pair(low, self._image(exposed, REFERENCE_MA, self.images[0], generator))
        else:
            other = self._image(exposed, self._current(draw), make, generator)
            pair = Pair(low, other) if draw.integers(2) else Pair(other, low)
        if not self.augment:
            return pair
        change = Augmentation.drawn(draw)
        return Pair(change(pair.input), change(pair.target))

    def _current(self, draw: np.random.Generator) -> float:
        low, high = self.tube_currents_ma
        return float(np.exp(draw.uniform(np.log(low), np.log(high))))

    def _image(self, exposed: ExposedSlice, current: float, make: MakeImage, generator: torch.Generator) -> Image:
        if exposed.grid is None:
            raise ValueError("The files of a data set for training say where the pixels of the truth are.")
        return make(exposed.exposure.scan(tube_current_ma=current, generator=generator), exposed.grid, generator)
