"""Detectability against dose: scans of a phantom with and without inserts, reconstructed and judged by observers."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import TypeAlias

import numpy as np
import torch
from jaxtyping import Float
from scipy.special import ndtri
from torch import Tensor

from pnpct.arrays import Image
from pnpct.evaluation.data.realisations import Reconstruct
from pnpct.evaluation.intervals import Interval
from pnpct.evaluation.observers.dose import DoseCurve
from pnpct.evaluation.observers.eye_filter import EyeFilter, Spectrum
from pnpct.evaluation.observers.model_observers import Detectability, channelised_hotelling, matched_filter
from pnpct.geometry import ImageGrid, Insert, disc_mask
from pnpct.physics import Exposure, take_log

READER = EyeFilter(distance=500.0, zoom=1.0)
"""Half a metre from a screen that shows the image in its true size."""

Patches: TypeAlias = Float[Tensor, "pairs side side"]


@dataclass(frozen=True, eq=False)
class InsertScans:
    """What is scanned, and where the inserts are in its image.

    Args:
        present: The phantom with its inserts.
        absent: The same without.
        inserts: The inserts, at least one.
        grid: Of the images.

    Raises:
        ValueError: If the exposures differ in geometry, or the patch of an insert reaches out of the image or into
            another insert.
    """

    present: Exposure
    absent: Exposure
    inserts: tuple[Insert, ...]
    grid: ImageGrid

    def __post_init__(self) -> None:
        if self.present.geometry != self.absent.geometry:
            raise ValueError("The phantoms with and without inserts must be scanned with one geometry.")
        if not self.inserts:
            raise ValueError("Detectability needs at least one insert to look for.")
        rows, cols = self.grid.shape
        for insert in self.inserts:
            row, col = self.corner(insert)
            if min(row, col) < 0 or row + self.side > rows or col + self.side > cols:
                raise ValueError(f"The patch of {self.side} pixels around {insert} must be inside the image.")
        reach = self.side * self.grid.spacing / 2
        for one, other in combinations(self.inserts, 2):
            apart = max(abs(a - b) for a, b in zip(one.center, other.center, strict=True))
            if apart < reach + max(one.diameter, other.diameter) / 2:
                raise ValueError(f"Each patch must hold one insert alone, but {one} and {other} are too near.")

    @property
    def side(self) -> int:
        """Side of the patches, pixels: twice the largest diameter."""
        return math.ceil(2 * max(insert.diameter for insert in self.inserts) / self.grid.spacing)

    def corner(self, insert: Insert) -> tuple[int, int]:
        """Return the first row and column of the patch around an insert, centred to half a pixel."""
        x, y = insert.center
        col, row = (x - self.grid.x[0]) / self.grid.spacing, (self.grid.y[0] - y) / self.grid.spacing
        return round(row - (self.side - 1) / 2), round(col - (self.side - 1) / 2)

    def patch_grid(self, insert: Insert) -> ImageGrid:
        """Return where the pixels of the patch around an insert are."""
        (row, col), spacing = self.corner(insert), self.grid.spacing
        to_middle = (self.side - 1) / 2 * spacing
        middle = float(self.grid.x[col] + to_middle), float(self.grid.y[row] - to_middle)
        return ImageGrid(self.side, self.side, spacing, center=middle)


@dataclass(frozen=True)
class InsertDetectability:
    """How well an insert is found in the images of one method at one dose.

    Args:
        insert: The insert.
        tube_current_ma: Tube current of the scans, mA.
        hotelling: The channelised Hotelling observer: the measure of dose.
        npwe: The non-prewhitening observer with an eye, which a blur fools; show it beside blurred FBP only.
        contrast_hu: Height of the disc of the insert's size that fits the mean difference best, HU.
        noise_hu: Standard deviation over the scans without insert, HU.
    """

    insert: Insert
    tube_current_ma: float
    hotelling: Detectability
    npwe: Detectability
    contrast_hu: float
    noise_hu: float


def detectability_by_dose(
    reconstruct: Reconstruct,
    scans: InsertScans,
    *,
    tube_currents_ma: Sequence[float],
    generator: torch.Generator,
    pairs: int = 200,
    batch: int = 16,
    eye: Spectrum = READER,
) -> Iterator[InsertDetectability]:
    """Yield how well each insert is found at each dose.

    At each dose `pairs` scans with and as many without inserts are drawn, turned into line integrals and
    reconstructed; patches are cut out around the inserts, and at the same places without them. Generators of one
    state give all methods the same scans.

    The template of the observer that does not prewhiten is the mean difference of one half of the images, averaged
    over rings around the insert up to its diameter; the other half is tested, and the other way round.

    Args:
        reconstruct: The method: from line integrals with weights [batch, views, bins] to images.
        scans: What is scanned.
        tube_currents_ma: Tube current of each dose, mA, > 0; four or more for a `DoseCurve`.
        generator: Source of the noise, of splits and resamples, on the device of the exposures.
        pairs: Scans of each kind at each dose, at least 40; 100 or more are advised.
        batch: Most scans that are reconstructed together, at least 1.
        eye: E of the NPWE observer; state distance and zoom of an `EyeFilter` with the result.

    Yields:
        For each dose in turn each insert.

    Raises:
        ValueError: If a number is out of its range, or the images are not on the grid (at a record).

    References:
        The protocol is that of FDA's LCD_CT, doi 10.5281/zenodo.7996580.
    """
    if pairs < 40 or batch < 1:  # with less, resamples of a half can be of a single image
        raise ValueError(f"At least 40 pairs of scans and batches of 1 or more are needed, got {pairs} and {batch}.")
    for tube_current_ma in tube_currents_ma:
        present, absent = (
            _patches(reconstruct, exposure, scans, tube_current_ma, pairs=pairs, batch=batch, generator=generator)
            for exposure in (scans.present, scans.absent)
        )
        random = np.random.default_rng(int(torch.randint(2**62, (), generator=generator, device=generator.device)))
        for number, insert in enumerate(scans.inserts):
            yield _judge(present[number], absent[number], scans, insert, tube_current_ma, eye, random)


def dose_curves(found: Sequence[InsertDetectability]) -> dict[Insert, DoseCurve]:
    """Sort d′ of the Hotelling observer, the measure of dose, by insert: d′ against tube current.

    Args:
        found: All records of one method.

    Raises:
        ValueError: If an insert has fewer than four doses, or a d′ that is not positive.
    """
    by_insert: dict[Insert, list[InsertDetectability]] = {}
    for record in found:
        by_insert.setdefault(record.insert, []).append(record)
    return {
        insert: DoseCurve(
            tuple(float(record.tube_current_ma) for record in records),
            tuple(record.hotelling.d_prime for record in records),
        )
        for insert, records in by_insert.items()
    }


def _patches(
    reconstruct: Reconstruct,
    exposure: Exposure,
    scans: InsertScans,
    tube_current_ma: float,
    *,
    pairs: int,
    batch: int,
    generator: torch.Generator,
) -> list[Patches]:
    """Patches around each insert, from scans that are drawn and reconstructed batch by batch."""
    cut: list[list[Patches]] = [[] for _ in scans.inserts]
    for first in range(0, pairs, batch):
        scan = _repeated(exposure, min(batch, pairs - first)).scan(tube_current_ma=tube_current_ma, generator=generator)
        images = _checked(reconstruct(take_log(scan)), len(scan.counts), scans.grid)
        for patches, insert in zip(cut, scans.inserts, strict=True):
            row, col = scans.corner(insert)
            patches.append(images[:, row : row + scans.side, col : col + scans.side].detach().cpu().clone())
    return [torch.cat(patches) for patches in cut]


def _repeated(exposure: Exposure, times: int) -> Exposure:
    mean, variance = (
        moment.expand(times, *moment.shape[-2:])
        for moment in (exposure.moments.signal_mean, exposure.moments.signal_variance)
    )
    return replace(exposure, moments=replace(exposure.moments, signal_mean=mean, signal_variance=variance))


def _checked(images: Image, count: int, grid: ImageGrid) -> Image:
    if tuple(images.shape) != (count, *grid.shape):
        raise ValueError(
            f"The method must return an image on the grid for each scan, {(count, *grid.shape)}, got the shape "
            f"{tuple(images.shape)}."
        )
    return images


def _judge(
    present: Patches,
    absent: Patches,
    scans: InsertScans,
    insert: Insert,
    tube_current_ma: float,
    eye: Spectrum,
    random: np.random.Generator,
) -> InsertDetectability:
    patch, (x, y) = scans.patch_grid(insert), insert.center
    disc = torch.from_numpy(disc_mask(insert.center, insert.diameter / 2, patch))
    difference = present.double().mean(0) - absent.double().mean(0)
    distance = np.hypot(patch.x[None, :] - x, patch.y[:, None] - y)
    rings = torch.from_numpy((distance / patch.spacing).round().astype(np.int64))
    near = torch.from_numpy(distance <= insert.diameter)
    return InsertDetectability(
        insert,
        tube_current_ma,
        hotelling=channelised_hotelling(
            present, absent, spacing=patch.spacing, diameter=insert.diameter, generator=random
        ),
        npwe=_not_prewhitened(present, absent, (rings, near), patch.spacing, eye, random),
        contrast_hu=1000 * float((difference * disc).sum() / disc.square().sum()),
        noise_hu=1000 * float(absent.double().var(dim=0).mean().sqrt()),
    )


def _not_prewhitened(
    present: Patches,
    absent: Patches,
    places: tuple[Tensor, Tensor],
    spacing: float,
    eye: Spectrum,
    random: np.random.Generator,
) -> Detectability:
    """Train on one half, test on the other, and the other way round; `places` are ring numbers, and which count."""
    rings, near = places
    half = len(present) // 2
    parts = (slice(0, half), slice(half, None))
    found = []
    for train, test in (parts, parts[::-1]):
        difference = present[train].double().mean(0) - absent[train].double().mean(0)
        sums = torch.zeros(int(rings.max()) + 1, dtype=torch.float64).index_add_(0, rings.ravel(), difference.ravel())
        template = (sums / torch.bincount(rings.ravel()).clamp(min=1))[rings] * near
        found.append(
            matched_filter(present[test], absent[test], signal=template, spacing=spacing, eye=eye, generator=random)
        )
    estimate = float(np.mean([each.d_prime.estimate for each in found]))
    error = math.hypot(*(each.d_prime.standard_error for each in found)) / 2
    width = float(ndtri(0.975)) * error
    interval = Interval(estimate, estimate - width, estimate + width, standard_error=error, level=0.95)
    return Detectability(interval, auc=float(np.mean([each.auc for each in found])), pairs=len(present))
