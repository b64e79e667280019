"""Training on images of one's own patients, without their scans: pairs of two doses, or low-dose series alone."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn
from typing_extensions import override

from pnpct.arrays import Image
from pnpct.denoisers.noise_level import is_noise_conditioned
from pnpct.files import ImageSeries, Split, read_series, sha256_of, sha256_of_folder
from pnpct.files.series_input import SUFFIXES
from pnpct.training.augmentation import change_alike
from pnpct.training.losses import mean_squared_error
from pnpct.training.pairs import Pair
from pnpct.training.pairwise import on_pairs
from pnpct.training.plan import Schedule, TrainingPlan
from pnpct.training.two_stage import Stage, train
from pnpct.units import from_hu, to_hu

_VALIDATION = 0.2
"""Share of the patients to validate on, where none are named."""

_VALIDATION_SLICES = 8

_OVERLAP = 1.05
"""Slices that are thicker than their distance, by more than rounding, share rays and noise."""


@dataclass(frozen=True, eq=False)
class SlicePairs:
    """Pairs by number: the same number is the same pair, whoever asks, in whatever order.

    The input is any slice of any patient. The target is the same slice of another series of that patient, or

        target = (slice below + slice above) / 2

    where there is no other. Neighbours have the same mean as the slice only as far as anatomy changes evenly from one
    to the next: what is seen in one slice alone is learnt as noise.

    Args:
        noisy: One series of each patient.
        targets: Another series of each, with the same slices and noise of its own; None takes neighbouring slices.
        seed: Seed of everything that is drawn.
        augment: Whether pairs are mirrored, turned, moved and scaled at random.
        side: Rows and columns of a patch, taken at random; None takes whole images.

    Raises:
        ValueError: If there is no patient, or a series of neighbours has fewer than three slices.
    """

    noisy: Sequence[ImageSeries]
    targets: Sequence[ImageSeries] | None
    seed: int
    augment: bool = True
    side: int | None = None

    def __post_init__(self) -> None:
        if not self.noisy:
            raise ValueError("Pairs are drawn from the images of at least one patient, got none.")
        shortest = min(len(series.z) for series in self.noisy)
        if self.targets is None and shortest < 3:
            raise ValueError(f"Neighbours on both sides need series of three slices or more, got {shortest}.")

    def __call__(self, number: int) -> Pair:
        """Draw the pair of a number, from 0 on.

        Raises:
            ValueError: If the images are smaller than the patch.
        """
        draw = np.random.default_rng([self.seed, number])
        pair = self.slices(int(draw.integers(len(self))))
        noisy, target = change_alike(pair, draw, augment=self.augment, side=self.side)
        return Pair(noisy, target)

    def __len__(self) -> int:
        return int(self._ends()[-1])

    def slices(self, index: int) -> tuple[Image, Image]:
        """Return the input and the target of a slice, counted through all patients, relative to water."""
        ends = self._ends()
        patient = int(np.searchsorted(ends, index, side="right"))
        at = index - int(ends[patient - 1] if patient else 0)
        if self.targets is not None:
            return _image(self.noisy[patient], at), _image(self.targets[patient], at)
        below, noisy, above = (_image(self.noisy[patient], at + step) for step in range(3))
        return noisy, (below + above) / 2

    def _ends(self) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
        without = 2 if self.targets is None else 0
        return np.cumsum([len(series.z) - without for series in self.noisy])


@dataclass(frozen=True, kw_only=True)
class NeighbouringSlices(Schedule):
    """Train on low-dose series of one's own patients alone: each slice is to predict the mean of its two neighbours.

    Args:
        low: Name of the low-dose images in the folder of each patient: a folder of a DICOM series, or a file (.h5,
            .nii, .nii.gz, .npz, .npy) by its name without the suffix.
        validation: Patients to validate on, by the names of their folders; if none, a fifth of them is drawn.

    References:
        Noise2Noise between neighbouring thin slices, as in Noise2Context (Zhang et al., Med. Phys. 48, 2021).
    """

    low: str = "low"
    validation: tuple[str, ...] = ()

    @override
    def settings(self) -> dict[str, Any]:
        return {**super().settings(), "validation": list(self.validation)}

    def plan(self, network: nn.Module, folder: Path) -> TrainingPlan:
        """Return the training of a network; the images of all patients are read here and held in memory.

        Args:
            network: The network, on its device.
            folder: Has a folder for each patient.

        Raises:
            OSError: If a file cannot be read.
            ValueError: If the network is noise-conditioned, images are missing, slices overlap that are to be
                neighbours, or the images of a pair are not in the same place.
        """
        if is_noise_conditioned(network):
            raise ValueError("A noise-conditioned network cannot learn from images alone, whose noise is not known.")
        of = self.patients(folder)
        pairs = self._pairs(of["train"], augment=True, side=self.side)
        held_out = self._pairs(of["validation"], augment=False, side=None)
        losses = on_pairs(pairs, mean_squared_error, bfloat16=self.bfloat16)
        options = {"stage": self._stage(), "epochs": self.epochs, **self.steps()}
        return TrainingPlan(
            partial(train, network, losses, **options),
            self.epochs,
            partial(_validate, network, held_out),
            finest_pixel=min(series.plane.spacing for series in pairs.noisy),
        )

    def patients(self, folder: Path) -> dict[Split, list[Path]]:
        """Return the folders of the patients to train and to validate on.

        Args:
            folder: Has a folder for each patient.

        Raises:
            OSError: If there is no such folder.
            ValueError: If there are fewer than two patients, one to validate on is not there, or none is left.
        """
        found = sorted(path for path in folder.iterdir() if path.is_dir() and not path.name.startswith("."))
        if len(found) < 2:
            raise ValueError(
                f"{folder} must hold a folder for each of two or more patients, to train and to validate on, but holds "
                f"{len(found)}."
            )
        held_out = set(self.validation)
        if missing := held_out - {path.name for path in found}:
            raise ValueError(f"{folder} has no patient {min(missing)} to validate on.")
        if not held_out:
            drawn = np.random.default_rng(self.seed).permutation(len(found))
            held_out = {found[each].name for each in drawn[: max(1, round(_VALIDATION * len(found)))]}
        if len(held_out) == len(found):
            raise ValueError(f"All {len(found)} patients are to validate on; leave some to train on.")
        return {
            "train": [path for path in found if path.name not in held_out],
            "validation": [path for path in found if path.name in held_out],
        }

    def fingerprints(self, folder: Path) -> dict[Split, list[str]]:
        """Return the SHA-256 of the images of each patient, to train and to validate on.

        Raises:
            OSError: If a file cannot be read.
            ValueError: If images are missing, or those of one patient are also those of another.
        """
        patients = self.patients(folder)
        prints: dict[Split, list[str]] = {
            split: [" ".join(map(_sha256, self._places(patient))) for patient in patients[split]] for split in patients
        }
        everyone = [each for split in prints.values() for each in split]
        if len(set(everyone)) < len(everyone):
            raise ValueError(f"{folder} holds the same images twice; give each patient one folder.")
        return prints

    def _stage(self) -> Stage:
        return "noise-to-noise"

    def _places(self, patient: Path) -> list[Path]:
        return [_named(patient, self.low)]

    def _pairs(self, patients: Sequence[Path], *, augment: bool, side: int | None) -> SlicePairs:
        read = [read_series(self._places(patient)[0]) for patient in patients]
        for patient, series in zip(patients, read, strict=True):
            apart = float(np.diff(series.z).min()) if len(series.z) > 1 else np.inf
            if series.slice_thickness is not None and series.slice_thickness > _OVERLAP * apart:
                raise ValueError(
                    f"{patient.name}: slices of {series.slice_thickness:g} mm that are {apart:g} mm apart overlap, so "
                    "that neighbours share their noise; reconstruct slices as thin as they are apart."
                )
        return SlicePairs(read, None, self.seed, augment, side)


@dataclass(frozen=True, kw_only=True)
class ImagePairs(NeighbouringSlices):
    """Train on pairs of images of one's own patients: at low dose, and the same slices at high dose.

    A second series at the same low dose serves as well as one at high dose if its noise is independent (Noise2Noise).

    Args:
        high: Name of the high-dose images, likewise.
    """

    high: str = "high"

    @override
    def _stage(self) -> Stage:
        return "supervised"

    @override
    def _places(self, patient: Path) -> list[Path]:
        return [_named(patient, name) for name in (self.low, self.high)]

    @override
    def _pairs(self, patients: Sequence[Path], *, augment: bool, side: int | None) -> SlicePairs:
        read = [[read_series(path) for path in self._places(patient)] for patient in patients]
        for patient, (low, high) in zip(patients, read, strict=True):
            _check_same_place(patient, low, high)
        return SlicePairs([low for low, _ in read], [high for _, high in read], self.seed, augment, side)


def _image(series: ImageSeries, at: int) -> Image:
    return from_hu(torch.from_numpy(series.image_hu[at].astype(np.float32)))


def _named(patient: Path, name: str) -> Path:
    """The folder or the file of the images with a name."""
    found = [path for path in (patient / f"{name}{suffix}" for suffix in ("", *SUFFIXES)) if path.exists()]
    if len(found) != 1:
        kinds = ", ".join(SUFFIXES)
        raise ValueError(
            f"{patient} must hold {name}, a folder of DICOM images or a file ({kinds}), once, but holds it "
            f"{len(found)} times."
        )
    return found[0]


def _sha256(path: Path) -> str:
    return sha256_of_folder(path) if path.is_dir() else sha256_of(path)


def _check_same_place(patient: Path, low: ImageSeries, high: ImageSeries) -> None:
    if low.image_hu.shape != high.image_hu.shape:
        raise ValueError(
            f"{patient.name}: pairs have slices and pixels alike, got {low.image_hu.shape} and {high.image_hu.shape}."
        )
    allowed = 0.1 * low.plane.spacing
    places = [(series.plane.x, series.plane.y, np.array(series.z)) for series in (low, high)]
    if any(np.abs(one - other).max() > allowed for one, other in zip(*places, strict=True)):
        raise ValueError(
            f"{patient.name}: the images of a pair are not in the same place; reconstruct both on one grid."
        )


def _validate(network: nn.Module, held_out: SlicePairs) -> dict[str, float]:
    """Return the RMS difference of outputs from targets, HU, on slices throughout patients that are held out."""
    device, training = next(network.parameters()).device, network.training
    network.eval()
    squares = []
    with torch.no_grad():
        for index in np.linspace(0, len(held_out) - 1, _VALIDATION_SLICES).round().astype(int).tolist():
            noisy, target = held_out.slices(index)
            output = network(noisy[None].to(device))[0].float().cpu()
            squares.append(float((to_hu(output) - to_hu(target)).square().mean()))
    network.train(training)
    return {"images": float(np.mean(squares)) ** 0.5}
