"""What a network learns from in the loop itself: low-dose scans of slices whose truth is known."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from pnpct.arrays import Image
from pnpct.evaluation import soft_tissue_mask
from pnpct.files import read_exposure, tube_voltages
from pnpct.geometry.short_repr import short_repr
from pnpct.operators import Projector
from pnpct.physics import DiagonalWeights, Exposure, Sinogram, take_log
from pnpct.physics.exposure import TUBE_VOLTAGE_KVP
from pnpct.reconstruction import ADMMState, DenoisedFBP, corrected_for_bone, fbp, starting_state
from pnpct.training.images import kept_projector

VIEWS = 492
"""About so many views of a scan are taken, with the dose of all: more would take longer and teach nothing else."""

DISCS, RADII_MM, CONTRASTS_HU = 40, (2.0, 10.0), (15.0, 70.0)
"""Discs that are drawn into the soft tissue of each slice: where faint detail is rare, it is best taken for noise."""


@dataclass(frozen=True, eq=False)
class LoopScan:
    """A slice, scanned at two doses, ready for plug-and-play.

    Args:
        sinogram: Line integrals and weights of both scans.
        A: The projector.
        start: The state to begin from.
        filtered: Sharp images of filtered back-projection, which a network alone is given.
        truth: The slice itself.
    """

    sinogram: Sinogram
    A: Projector
    start: ADMMState
    filtered: Float[Tensor, "doses rows cols"]
    truth: Float[Tensor, "rows cols"]

    __repr__ = short_repr


@dataclass(frozen=True, eq=False)
class LoopScans:
    """Scans by number: the same number is the same slice with the same noise, whoever asks, in whatever order.

    Slice, tube voltage and both tube currents are drawn for each, the currents evenly in their logarithm from either
    half of the range. They are those at 120 kVp; at other voltages they are larger or smaller by the cube of the ratio,
    about as a tube gives less or more.

    Args:
        files: Files of exposures.
        tube_currents_ma: Lowest and highest tube current at 120 kVp, mA.
        seed: Seed of everything that is drawn.

    Raises:
        ValueError: If there are no files, or the currents are not positive and rising.
    """

    files: Sequence[Path]
    tube_currents_ma: tuple[float, float]
    seed: int = 0

    def __post_init__(self) -> None:
        low, high = self.tube_currents_ma
        if not self.files:
            raise ValueError("Scans are drawn from at least one file, got none.")
        if not 0 < low <= high < float("inf"):
            raise ValueError(f"Tube currents are positive and rising, in mA, got {low} and {high}.")

    def __call__(self, number: int) -> LoopScan:
        """Draw the scans of a number, from 0 on.

        Raises:
            OSError: If a file cannot be read.
            ValueError: If a file does not say where the pixels of its truth are.
        """
        draw = np.random.default_rng([self.seed, number])
        path = self.files[int(draw.integers(len(self.files)))]
        voltages = tube_voltages(path)
        voltage = voltages[int(draw.integers(len(voltages)))]
        exposed = read_exposure(path, tube_voltage_kvp=voltage)
        if (grid := exposed.grid) is None or (truth := exposed.truth) is None:
            raise ValueError(f"{path} does not say where the pixels of the truth are.")
        geometry, step = exposed.exposure.geometry, max(exposed.exposure.geometry.views // VIEWS, 1)
        views = slice(int(draw.integers(step)), None, step)
        change = drawn_discs(truth, grid.spacing, draw)
        whole = kept_projector(grid, geometry, exposed.exposure.mu_water)
        exposure = changed(exposed.exposure, change, whole)
        A = kept_projector(grid, geometry[views], exposure.mu_water)
        low, high = np.log(self.tube_currents_ma)
        louder = (TUBE_VOLTAGE_KVP / voltage) ** 3 * step
        generator = torch.Generator().manual_seed(int(draw.integers(2**62)))
        logarithms = [
            take_log(exposure.scan(tube_current_ma=louder * float(np.exp(current)), generator=generator)[views])
            for current in (draw.uniform(low, (low + high) / 2), draw.uniform((low + high) / 2, high))
        ]
        y = torch.stack([each.line_integrals for each in logarithms])
        weights = torch.stack([each.weights.diagonal for each in logarithms])
        both = replace(logarithms[0], line_integrals=y, weights=DiagonalWeights(weights, A.geometry.shape))
        sinogram = corrected_for_bone(both, A)
        filtered = fbp(sinogram.line_integrals, A, kernel=DenoisedFBP.kernel)
        return LoopScan(sinogram, A, starting_state(sinogram, A), filtered, truth + change)


def drawn_discs(truth: Image, spacing: float, draw: np.random.Generator) -> Image:
    """Draw what discs change in the soft tissue of a slice, relative to water; nothing where there is none.

    Args:
        truth: The slice.
        spacing: Of the pixels, mm.
        draw: Generator of what is drawn.
    """
    soft = soft_tissue_mask(truth).numpy()
    rows, cols = np.indices(truth.shape)
    change = np.zeros(truth.shape, np.float32)
    places = np.argwhere(soft)
    for _ in range(DISCS if len(places) else 0):
        row, col = places[draw.integers(len(places))]
        radius = float(np.exp(draw.uniform(*np.log(RADII_MM))))
        contrast = float(draw.uniform(*CONTRASTS_HU) * draw.choice([-1, 1]))
        away = spacing * np.hypot(rows - row, cols - col)
        change += contrast / 1000 * np.clip((radius - away) / spacing + 0.5, 0, 1)
    return torch.from_numpy(change * soft)


def changed(exposure: Exposure, change: Image, A: Projector) -> Exposure:
    """Return the exposure of a slice with a little more or less attenuation, the same at every energy.

    Args:
        exposure: The exposure.
        change: What is added to the slice, relative to water.
        A: The projector.
    """
    passed: Float[Tensor, "views bins"] = torch.exp(-(A @ change))
    mean, variance = exposure.moments.signal_mean * passed, exposure.moments.signal_variance * passed
    return replace(exposure, moments=replace(exposure.moments, signal_mean=mean, signal_variance=variance))
