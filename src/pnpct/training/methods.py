"""The ways to train a denoiser: frozen values; their fields are the options, and the only place of the defaults.

A method makes a `TrainingPlan` of a network and of what it learns from; the plan is iterated over in epochs.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import torch
from torch import nn
from typing_extensions import override

from pnpct.denoisers import LearnedDenoiser
from pnpct.denoisers.noise_level import is_noise_conditioned
from pnpct.files import MANIFEST, Split, exposure_pixel, read_manifest, read_network, sha256_of
from pnpct.geometry import ImageGrid
from pnpct.physics import Scan
from pnpct.training.cached_examples import CachedExamples
from pnpct.training.closed_loop import ClosedLoop
from pnpct.training.examples import Example, Examples, Reference
from pnpct.training.images import FBPImages, LoopImages, view_subset_images
from pnpct.training.losses import (
    CONTRAST_WEIGHT,
    TEXTURE_WEIGHT,
    Form,
    mean_squared_error,
    stage_one_loss,
    stage_two_loss,
)
from pnpct.training.own_images import ImagePairs, NeighbouringSlices
from pnpct.training.pairs import Pairs
from pnpct.training.pairwise import on_pairs
from pnpct.training.plan import Schedule, TrainingPlan
from pnpct.training.single_scan import SplitViewPairs
from pnpct.training.through_loop import ThroughLoop
from pnpct.training.two_stage import Epoch, train, two_stage
from pnpct.training.validation import validate

CPU = torch.device("cpu")


@dataclass(frozen=True, kw_only=True)
class Supervised(Schedule):
    """Train on dose pairs of data sets: low-dose images, and what they should be.

    Args:
        also: Folders of further data sets to train on.
        loop_denoiser: Network in the ADMM loop, by name or file; total variation if None.
        loop_iterations: Maximum number of iterations of the loop.
        loop_images: Images taken from each loop; more cost little time.
        examples: Slices that are scanned and reconstructed, before they are repeated with other augmentations.
        cache: Folder where their images are cached, for this and other trainings; None draws them again.
        lowest_ma: Lowest tube current of low-dose scans, mA.
        highest_ma: Highest tube current of low-dose scans, mA.
        reference: Target of the dose pairs: FBP images of reference scans at this tube current, mA; "noise-free", each
            image as it would be without noise, equally blurred; or "truth", the phantom itself.
        discount: Power of the noise that noisy pairs are down-weighted by, 0 to 4.
        reconstructed: Slices of the patients for validation that are reconstructed around the network after each epoch,
            and compared with the truth; each takes as long as any reconstruction.
    """

    also: tuple[Path, ...] = ()
    loop_denoiser: str | None = None
    loop_iterations: int = LoopImages.iterations
    loop_images: int = LoopImages.number
    examples: int = 1000
    cache: Path | None = None
    lowest_ma: float = Examples.tube_currents_ma[0]
    highest_ma: float = Examples.tube_currents_ma[1]
    reference: Reference = Examples.reference
    discount: float = Pairs.discount
    reconstructed: int = 0

    @override
    def settings(self) -> dict[str, Any]:
        settings = super().settings()
        del settings["cache"], settings["reconstructed"]
        denoiser = self.loop_denoiser and read_network(self.loop_denoiser)[1]
        return {**settings, "also": _manifests(self.also), "loop_denoiser": denoiser}

    def plan(self, network: nn.Module, data: Path) -> TrainingPlan:
        """Return the training of a network on a data set.

        Args:
            network: The network, on its device.
            data: Folder of the data set, as `simulate_dataset` makes it.

        Raises:
            OSError: If a file cannot be read.
            ValueError: If a part of the data set is empty, an option is out of range, or the network of the loop
                is noise-conditioned.
        """
        if self.reconstructed < 0 or (self.reconstructed and is_noise_conditioned(network)):
            raise ValueError(
                "Slices are reconstructed around a network without noise level, and none or more of them, got "
                f"{self.reconstructed}."
            )
        device = next(network.parameters()).device
        validation = self.examples_from(data, "validation", device=device)
        drawn = self.examples_from(data, "train", device=device)
        pairs = partial(Pairs, drawn, distinct=self.examples, side=self.side, discount=self.discount)
        epochs, total = self._stages(network, pairs)
        pixels = [pixel for file in self._files(data, "train") if (pixel := exposure_pixel(file)) is not None]
        held_out = self._files(data, "validation")[: self.reconstructed]
        tried = ClosedLoop(held_out, (self.lowest_ma, self.highest_ma), self.seed) if held_out else None
        check = partial(_checked, network, lru_cache(validation), tried)
        return TrainingPlan(epochs, total, check, finest_pixel=min(pixels, default=None))

    def _stages(self, network: nn.Module, pairs: Callable[..., Pairs]) -> tuple[Callable[..., Iterator[Epoch]], int]:
        dosed = pairs(kind="dose", seed=self.seed + 1)
        losses = on_pairs(dosed, mean_squared_error, bfloat16=self.bfloat16)
        return partial(train, network, losses, stage="supervised", epochs=self.epochs, **self.steps()), self.epochs

    def examples_from(self, data: Path, split: Split, *, device: torch.device = CPU) -> Examples | CachedExamples:
        """Return the examples of one part of the data sets, by number.

        Args:
            data: Folder of the first data set.
            split: Which part.
            device: Where the network of the loop computes.

        Raises:
            OSError: If a file cannot be read.
            ValueError: If the part is empty, an option is out of range, or the network of the loop is
                noise-conditioned.
        """
        loop, datasets, files = self._loop(device), (data, *self.also), self._files(data, split)
        if not files:
            raise ValueError(f"{data} has no patients for {split}; simulate more of them.")
        towards: dict[str, Any] = {"reference": self.reference}
        if self.reference == "noise-free":
            towards["make_references"] = (FBPImages(), loop.undisturbed())
        currents, source = (self.lowest_ma, self.highest_ma), " ".join(_manifests(datasets))
        options = {"seed": self.seed, "tube_currents_ma": currents, "source": source, **towards}
        examples = Examples(files, FBPImages(), (loop,), **options)
        return examples if self.cache is None else CachedExamples(examples, self.cache)

    def _files(self, data: Path, split: Split) -> list[Path]:
        return [dataset / name for dataset in (data, *self.also) for name in read_manifest(dataset).files(split)]

    def _loop(self, device: torch.device) -> LoopImages:
        """The ADMM loop that images are taken from."""
        loop = LoopImages(iterations=self.loop_iterations, number=self.loop_images)
        if self.loop_denoiser is None:
            return loop
        network, fingerprint = read_network(self.loop_denoiser)
        if is_noise_conditioned(network):
            raise ValueError(
                f"{self.loop_denoiser} is noise-conditioned, but the loop of training does not know the noise level."
            )
        name = f"{fingerprint}{' in bfloat16' if self.bfloat16 else ''}"
        return replace(loop, denoiser=LearnedDenoiser(network.to(device), bfloat16=self.bfloat16), name=name)


@dataclass(frozen=True, kw_only=True)
class TwoStage(Supervised):
    """Train as the paper does: first on pairs of noisy images of data sets (Noise2Noise), then on dose pairs.

    Args:
        fine_tuning_epochs: Epochs of the second stage.
        losses: Loss of the second stage: "corrected", or as printed in the "paper", which cannot reach its goal.
        texture_weight: Weight of the texture term in that loss, (HU / 1000)².
        contrast_weight: Weight of its contrast term, (HU / 1000)².

    Raises:
        ValueError: If a weight is negative or not finite.
    """

    fine_tuning_epochs: int = 20
    losses: Form = "corrected"
    texture_weight: float = TEXTURE_WEIGHT
    contrast_weight: float = CONTRAST_WEIGHT

    def __post_init__(self) -> None:
        weights = self.texture_weight, self.contrast_weight  # checked here, since the second stage begins after hours
        if not all(0 <= weight < math.inf for weight in weights):
            raise ValueError(f"Weights of a loss are numbers from 0 up, got {weights[0]:g} and {weights[1]:g}.")

    @override
    def _stages(self, network: nn.Module, pairs: Callable[..., Pairs]) -> tuple[Callable[..., Iterator[Epoch]], int]:
        noisy, dosed = pairs(kind="noisy", seed=self.seed), pairs(kind="dose", seed=self.seed + 1)
        second = partial(
            stage_two_loss,
            form=self.losses,
            texture_weight=self.texture_weight,
            contrast_weight=self.contrast_weight,
        )
        epochs = self.epochs, self.fine_tuning_epochs
        options = {"epochs": epochs, "losses": (stage_one_loss, second), "bfloat16": self.bfloat16, **self.steps()}
        return partial(two_stage, network, noisy, dosed, **options), sum(epochs)


@dataclass(frozen=True, kw_only=True)
class SingleScan(Schedule):
    """Train on one scan: its views are divided into subsets, and each subset is predicted from the others.

    Args:
        parts: Number of subsets, each of at least 30 views.
    """

    parts: int = 4

    def plan(self, network: nn.Module, scan: Scan, grid: ImageGrid) -> TrainingPlan:
        """Return the training of a network on a scan; the images of its parts are made here.

        Args:
            network: The network, on its device.
            scan: The scan, of one slice or of several.
            grid: Where the pixels of the images are.

        Raises:
            ValueError: If the network is noise-conditioned, or the parts cannot be made.
        """
        if is_noise_conditioned(network):
            raise ValueError(
                "A noise-conditioned network cannot learn from a single scan, since its noise is not known."
            )
        pairs = SplitViewPairs(view_subset_images(scan, grid, self.parts), self.seed, side=self.side)
        losses = on_pairs(pairs, mean_squared_error, bfloat16=self.bfloat16)
        options = {"stage": "single-scan", "epochs": self.epochs, **self.steps()}
        return TrainingPlan(partial(train, network, losses, **options), self.epochs, dict, finest_pixel=grid.spacing)


METHODS: dict[str, type[Supervised | ThroughLoop | SingleScan | NeighbouringSlices]] = {
    "two-stage": TwoStage,
    "supervised": Supervised,
    "through-loop": ThroughLoop,
    "single-scan": SingleScan,
    "image-pairs": ImagePairs,
    "neighbouring-slices": NeighbouringSlices,
}
"""The methods by their names."""


def _checked(D: nn.Module, examples: Callable[[int], Example], tried: ClosedLoop | None) -> dict[str, float]:
    """How far the network is from references, and plug-and-play around it from the truth if that is asked for."""
    return validate(D, examples) | (tried(D) if tried else {})


def _manifests(datasets: Sequence[Path]) -> list[str]:
    """The SHA-256 of the manifest of each data set."""
    return [sha256_of(dataset / MANIFEST) for dataset in datasets]
