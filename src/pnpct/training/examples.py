"""Training examples: images of three scans of one slice, drawn from the exposures of a data set."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from pnpct.files import read_exposure, tube_voltages
from pnpct.geometry.short_repr import short_repr
from pnpct.physics import Scan
from pnpct.training.images import MakeImages

Reference: TypeAlias = float | Literal["noise-free", "truth"]
"""The target: the image of a scan at this tube current, mA; or of the low-dose scan with the mean of its counts, and so
with the weights that it has; or the phantom itself, without any blur."""

REFERENCE: Reference = 800.0
"""A routine scan at high dose."""


@dataclass(frozen=True, eq=False)
class Example:
    """One slice, scanned twice at a low dose, with noise of its own each time, and what it looks like without.

    Args:
        low: FBP images of the two low-dose scans.
        others: Other images of the first of these scans.
        references: Targets: of the FBP images first, then of each of the others.
    """

    low: Float[Tensor, "scans=2 rows cols"]
    others: Float[Tensor, "others rows cols"]
    references: Float[Tensor, "1+others rows cols"]

    __repr__ = short_repr

    @property
    def noise_level(self) -> float:
        """Standard deviation of the noise of the low-dose FBP images, over the whole image, relative to water."""
        return math.sqrt(float((self.low[0] - self.low[1]).square().mean()) / 2)


@dataclass(frozen=True, eq=False)
class Examples:
    """Examples by number: the same number is the same example, whoever asks, in whatever order.

    The slice, the tube voltage and the tube current (evenly in its logarithm) are drawn for each.

    Args:
        files: Files of exposures.
        make: FBP, or another way to make one image with noise of mean zero.
        others: Other ways to make images, with noise that a denoiser should know.
        seed: Seed of everything that is drawn.
        tube_currents_ma: Lowest and highest tube current of the low-dose scans, mA.
        reference: Tube current of high-dose scans, mA, "noise-free" or "truth". The noise of scans does not mislead a
            network, but drowns what it could learn wherever its output is nearer to the truth than they are; their blur
            it learns.
        make_references: How images of the high-dose or noise-free scan are made, for `make` and for each of `others`,
            with the same random settings as theirs; None makes one, by `make`, for all.
        source: What the files are, such as the SHA-256 of their manifest; it tells data sets apart in `settings`.

    Raises:
        ValueError: If there are no files, the currents are not positive and rising or the high one is below the low
            ones, the truth is to be made of a scan, or there is not one reference for each way.
    """

    files: Sequence[Path]
    make: MakeImages
    others: Sequence[MakeImages]
    seed: int
    tube_currents_ma: tuple[float, float] = (20.0, 200.0)
    reference: Reference = REFERENCE
    make_references: Sequence[MakeImages] | None = None
    source: str = ""

    def __post_init__(self) -> None:
        low, high = self.tube_currents_ma
        if not self.files:
            raise ValueError("Examples are drawn from at least one file, got none.")
        if not 0 < low <= high < math.inf:
            raise ValueError(f"Tube currents are positive and rising, in mA, got {low} and {high}.")
        if not isinstance(self.reference, str) and not high <= self.reference < math.inf:
            raise ValueError(f"The high dose is at least the low dose of up to {high} mA, got {self.reference} mA.")
        if self.make_references is not None:
            if self.reference == "truth":
                raise ValueError("The truth is not made of a scan; leave out how images of high-dose scans are made.")
            if len(self.make_references) != 1 + len(self.others):
                ways = 1 + len(self.others)
                raise ValueError(
                    f"Images made in {ways} ways have as many references, not {len(self.make_references)}."
                )

    @property
    def settings(self) -> dict[str, Any]:
        """What an example depends on besides its number, as plain values."""
        ways = self.make_references
        return {
            "source": self.source,
            "files": [f"{path.parent.name}/{path.name}" for path in self.files],
            "images": [dict(make.settings) for make in (self.make, *self.others)],
            "references": None if ways is None else [dict(make.settings) for make in ways],
            "reference": self.reference,
            "tube_currents_ma": list(self.tube_currents_ma),
            "seed": self.seed,
        }

    def __call__(self, number: int) -> Example:
        """Draw the example of a number, from 0 on.

        Raises:
            OSError: If a file cannot be read.
            ValueError: If a file does not say where the pixels of its truth are.
        """
        draw = np.random.default_rng([self.seed, number])
        generator = torch.Generator().manual_seed(int(draw.integers(2**62)))
        path = self.files[int(draw.integers(len(self.files)))]
        voltages = tube_voltages(path)
        exposed = read_exposure(path, tube_voltage_kvp=voltages[int(draw.integers(len(voltages)))])
        if (grid := exposed.grid) is None or (truth := exposed.truth) is None:
            raise ValueError(f"{path} does not say where the pixels of the truth are.")
        current = float(np.exp(draw.uniform(*np.log(self.tube_currents_ma))))
        scans = [exposed.exposure.scan(tube_current_ma=current, generator=generator) for _ in range(2)]
        settings = int(draw.integers(2**62))

        def made(make: MakeImages, scan: Scan) -> Float[Tensor, "images rows cols"]:
            return make(scan, grid, torch.Generator().manual_seed(settings)).reshape(-1, *grid.shape)

        low = torch.cat([made(self.make, scan) for scan in scans])
        others = torch.cat([low[:0], *(made(make, scans[0]) for make in self.others)])
        if self.reference == "truth":
            references = truth[None]
        else:
            better = (
                exposed.exposure.scan(tube_current_ma=current, generator=None)
                if self.reference == "noise-free"
                else exposed.exposure.scan(tube_current_ma=self.reference, generator=generator)
            )
            references = torch.cat([made(make, better) for make in self.make_references or [self.make]])
        if len(references) == 1:
            references = references.expand(1 + len(others), -1, -1)
        return Example(low, others, references)
