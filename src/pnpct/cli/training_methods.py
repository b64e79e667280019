"""The methods of `pnpct train`, each with the options that have an effect on it, and what it makes of its data."""

import math
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import torch
from torch import nn
from typing_extensions import override

from pnpct.cli.grids import grid_for
from pnpct.cli.terminal import working
from pnpct.cli.training_images import view_subset_images
from pnpct.cli.training_setup import ReferenceName, examples_of, manifests_of, validate
from pnpct.files import MANIFEST, network_file, read_scan, sha256_of
from pnpct.training import (
    CONTRAST_WEIGHT,
    TEXTURE_WEIGHT,
    Epoch,
    Examples,
    Form,
    Pairs,
    SplitViewPairs,
    mean_squared_error,
    stage_one_loss,
    stage_two_loss,
    train,
    two_stage,
)


@dataclass(frozen=True)
class Lesson:
    """What a network is taught.

    Args:
        epochs: From a network and options of `train` to epochs.
        total: How many epochs these are.
        validate: From a network to figures of how well it does; none where nothing is known to be better.
    """

    epochs: Callable[..., Iterator[Epoch]]
    total: int
    validate: Callable[[nn.Module], dict[str, float]]


@dataclass(frozen=True)
class Supervised:
    """Learn from dose pairs of a data set alone."""

    also: tuple[Path, ...] = ()
    loop_denoiser: str | None = None
    loop_iterations: int = 3
    loop_images: int = 1
    examples: int = 1000
    kept: Path | None = None
    lowest_ma: float = 20.0
    highest_ma: float = 200.0
    reference: ReferenceName = Examples.reference
    discount: float = Pairs.discount

    def settings(self) -> dict[str, Any]:
        """Return all options that the weights depend on."""
        settings = asdict(self)
        del settings["kept"]
        denoiser = self.loop_denoiser and sha256_of(network_file(self.loop_denoiser))
        return {**settings, "also": manifests_of(self.also), "loop_denoiser": denoiser}

    def digest(self, data: Path) -> str:
        """Return the SHA-256 of the data set's manifest."""
        if data.is_file():
            raise ValueError(
                f"{data} is a file, but a data set's folder is needed; --method single-scan learns from a scan."
            )
        return sha256_of(data / MANIFEST)

    def lesson(
        self, data: Path, *, epochs: int, seed: int, side: int | None, bfloat16: bool, device: torch.device
    ) -> Lesson:
        """Return what a network learns from the data set."""
        examples = partial(
            examples_of,
            (data, *self.also),
            loop_denoiser=self.loop_denoiser,
            loop_iterations=self.loop_iterations,
            loop_images=self.loop_images,
            bfloat16=bfloat16,
            device=device,
            seed=seed,
            tube_currents_ma=(self.lowest_ma, self.highest_ma),
            reference=self.reference,
            kept=self.kept,
        )
        validation = examples(split="validation")
        drawn = examples(split="train")
        pairs = partial(Pairs, drawn, distinct=self.examples, side=side, discount=self.discount)
        taught, total = self._taught(pairs, epochs, seed)
        return Lesson(taught, total, partial(validate, examples=validation))

    def _taught(
        self, pairs: Callable[..., Pairs], epochs: int, seed: int
    ) -> tuple[Callable[..., Iterator[Epoch]], int]:
        dosed = pairs(kind="dose", seed=seed + 1)
        return partial(train, pairs=dosed, stage="supervised", loss=mean_squared_error, epochs=epochs), epochs


@dataclass(frozen=True)
class TwoStage(Supervised):
    """Learn as the paper does, first from pairs of noisy images of the data set."""

    fine_tuning_epochs: int = 20
    losses: Form = "corrected"
    texture_weight: float = TEXTURE_WEIGHT
    contrast_weight: float = CONTRAST_WEIGHT

    def __post_init__(self) -> None:
        weights = self.texture_weight, self.contrast_weight  # checked here, since the second stage begins after hours
        if not all(0 <= weight < math.inf for weight in weights):
            raise ValueError(f"Weights of a loss are numbers from 0 up, got {weights[0]:g} and {weights[1]:g}.")

    @override
    def _taught(
        self, pairs: Callable[..., Pairs], epochs: int, seed: int
    ) -> tuple[Callable[..., Iterator[Epoch]], int]:
        noisy, dosed = pairs(kind="noisy", seed=seed), pairs(kind="dose", seed=seed + 1)
        both = epochs, self.fine_tuning_epochs
        second = partial(
            stage_two_loss,
            form=self.losses,
            texture_weight=self.texture_weight,
            contrast_weight=self.contrast_weight,
        )
        losses = stage_one_loss, second
        return partial(two_stage, noisy=noisy, dosed=dosed, epochs=both, losses=losses), sum(both)


@dataclass(frozen=True)
class SingleScan:
    """Learn from one scan, of which a part of the views is set against the others."""

    parts: int = 4

    def settings(self) -> dict[str, Any]:
        """Return all options that the weights depend on."""
        return asdict(self)

    def digest(self, data: Path) -> str:
        """Return the SHA-256 of the scan."""
        if data.is_dir():
            raise ValueError(
                f"{data} is a folder, but --method single-scan needs the file of a scan; the others learn from folders."
            )
        return sha256_of(data)

    def lesson(
        self, data: Path, *, epochs: int, seed: int, side: int | None, bfloat16: bool, device: torch.device
    ) -> Lesson:
        """Return what a network learns from the scan; only its loss says how well it does."""
        del bfloat16, device  # the images are made once, by FBP
        scan = read_scan(data)
        grid = grid_for(data, scan.geometry, size=None, field_of_view=None)
        with working("Reconstructing the parts of the scan"):
            images = view_subset_images(scan, grid, self.parts)
        pairs = SplitViewPairs(images, seed, side=side)
        taught = partial(train, pairs=pairs, stage="single-scan", loss=mean_squared_error, epochs=epochs)
        return Lesson(taught, epochs, lambda _: {})


METHODS: dict[str, type[TwoStage | Supervised | SingleScan]] = {
    "two-stage": TwoStage,
    "supervised": Supervised,
    "single-scan": SingleScan,
}
